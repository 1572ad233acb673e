"""Where things are, and how the program is called."""

import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "results" / "published"


class Wrong(Exception):
    """An error that the user can correct: what, where and how."""


def sweep(*arguments, output=None, may_fail=()):
    """Runs the program, from SWEEP or built first; its output goes to a file, if one is named."""
    program = os.environ.get("SWEEP")
    command = [program] if program else ["cargo", "run", "--quiet", "--release", "--"]
    command += [str(argument) for argument in arguments]
    stream = open(output, "w", encoding="utf-8") if output else None
    try:
        code = subprocess.run(command, cwd=ROOT, stdout=stream, check=False).returncode
    finally:
        if stream:
            stream.close()
    if code != 0 and code not in may_fail:
        raise Wrong(f"{' '.join(command)} ended with {code}")


def physics_of_the_program():
    """PHYSICS_VERSION, as the source has it."""
    declaration = re.compile(r"^pub const PHYSICS_VERSION: u32 = (\d+);", re.MULTILINE)
    for file in sorted((ROOT / "crates" / "sweep" / "src").rglob("*.rs")):
        if found := declaration.search(file.read_text(encoding="utf-8")):
            return int(found[1])
    raise Wrong("no file in crates/sweep/src declares PHYSICS_VERSION")
