"""The list of mutants fits the code: each breaks one line that is there, and names tests that are."""

from tools.mutants import ROOT, Mutant, faults, load_mutants


def test_every_mutant_breaks_one_line():
    mutants = load_mutants(ROOT / "tests" / "mutants.toml")
    assert len(mutants) >= 80 and faults(mutants, ROOT) == []
    assert len({(one.file, one.line, one.becomes) for one in mutants}) == len(mutants)


def test_what_is_wrong_with_a_list_is_told(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\ny = 1\n")
    wrong = [Mutant("a.py", " = 1", " = 2", ("a.py",)), Mutant("a.py", "x = 1", "x = 1", ("b.py",))]
    assert len(faults(wrong, tmp_path)) == 3
    assert faults([Mutant("a.py", "x = 1", "x = 2", ("a.py",))], tmp_path) == []
