"""Known faults of the packages in environment.lock, by pip-audit: ``make audit``.

pip-audit is no part of the environment: uv fetches it for the one run. Exit code 0 where no fault is known,
1 where one is, 2 where the packages could not be looked up.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


def report(found: dict[str, Any]) -> tuple[list[str], int]:
    """What pip-audit's JSON says, in lines, and the exit code."""
    packages = found["dependencies"]
    known = [package for package in packages if "vulns" in package]
    lines = [
        f"{package['name']} {package['version']}: {fault['id']}, "
        + (f"mended in {', '.join(fault['fix_versions'])}" if fault["fix_versions"] else "not mended yet")
        for package in known
        for fault in package["vulns"]
    ]
    faults = len(lines)
    lines.append(f"{faults} known faults in {len(known)} of {len(packages)} packages of environment.lock.")
    if len(known) < len(packages):
        lines.append(
            f"{len(packages) - len(known)} could not be looked up on the package index: check the network."
        )
    return lines, 1 if faults else 2 if len(known) < len(packages) else 0


def main() -> int:
    command = [
        *(str(ROOT / ".venv/bin/uv"), "tool", "run", "pip-audit", "--progress-spinner", "off"),
        *(
            "--requirement",
            str(ROOT / "environment.lock"),
            "--require-hashes",
            "--disable-pip",
            "--format",
            "json",
        ),
    ]
    # No shell, and no word of anyone else's.
    ran = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    try:
        lines, code = report(json.loads(ran.stdout))
    except (ValueError, KeyError, TypeError):
        said = (ran.stderr.strip().splitlines() or ["without a word"])[-1]
        lines, code = [f"pip-audit did not run ({said}): check the network."], 2
    print("\n".join(lines))
    return code


if __name__ == "__main__":
    sys.exit(main())
