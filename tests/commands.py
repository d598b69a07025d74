"""Commands of `wildlab` as they are typed, within the process of the test."""

from __future__ import annotations

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

import pytest

from wildlab import cli


def call(*arguments: object) -> tuple[object, str, str]:
    """Exit code, standard output and standard error of a command."""
    with (
        pytest.raises(SystemExit) as ended,
        redirect_stdout(StringIO()) as out,
        redirect_stderr(StringIO()) as err,
    ):
        cli.main([str(one) for one in arguments])
    return ended.value.code, out.getvalue(), err.getvalue()


def succeed(*arguments: object) -> str:
    """Standard output of a command that ends well."""
    code, out, err = call(*arguments)
    assert code == 0, err
    return out


def refuse(*arguments: object) -> str:
    """What a command that is used in a wrong way, or whose input cannot be used, says on standard error."""
    code, out, err = call(*arguments)
    assert code == 2 and not out and "Traceback" not in err, err
    return " ".join(err.split())
