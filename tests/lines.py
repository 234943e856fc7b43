#!/usr/bin/env python3
"""Counts the lines of code of `src` by folder: no blank lines, no comments, no tests.

    python3 tests/lines.py                        # the working tree
    python3 tests/lines.py --rev HEAD~10          # a revision
    python3 tests/lines.py --rev v0.1 --rev HEAD  # two, side by side

A line counts where anything but white space is left of it once comments (`//`, `///`, `//!`, `/* */`)
are gone; strings are not mistaken for comments. Out are files that are modules of tests only (named by
`#[cfg(test)] mod NAME;`, and everything below them) and every item under `#[cfg(test)]`.
"""

import argparse
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TEST = re.compile(r"#\[cfg\((?:test|all\(test\b[^\n]*\))\)\]")
# items that a semicolon alone ends, and those that a brace or a semicolon ends; a comma ends all others
UNBRACED = {"use", "const", "static", "type", "let"}
BLOCKS = {"fn", "impl", "struct", "enum", "trait", "mod"}
# what must be skipped as a whole when braces are counted or comments looked for
TOKEN = re.compile(
    r"""(?P<line>//[^\n]*)
      | (?P<block>/\*)
      | (?P<raw>\bb?r(?P<hashes>\#*)".*?"(?P=hashes))
      | (?P<string>b?"(?:\\.|[^"\\])*")
      | (?P<char>b?'(?:\\u\{[^}]*\}|\\.|[^'\\\n])')""",
    re.VERBOSE | re.DOTALL,
)


def sources(revision):
    """Path below `src` -> text, of a revision or of the working tree (None)."""
    if revision is None:
        base = ROOT / "src"
        return {
            path.relative_to(base).as_posix(): path.read_text(encoding="utf-8")
            for path in sorted(base.rglob("*.rs"))
        }
    git = ["git", "-C", str(ROOT)]
    names = subprocess.run(
        [*git, "ls-tree", "-r", "--name-only", "-z", revision, "src"],
        check=True, capture_output=True, text=True,
    ).stdout.split("\0")
    out = {}
    for name in names:
        if name.endswith(".rs"):
            text = subprocess.run(
                [*git, "show", f"{revision}:{name}"], check=True, capture_output=True, text=True
            ).stdout
            out[name.removeprefix("src/")] = text
    if not out:
        sys.exit(f"no Rust files under src at {revision}")
    return out


def block_end(text, start):
    """The end of the block comment at `start`; they nest."""
    depth, at = 0, start
    while True:
        mark = re.compile(r"/\*|\*/").search(text, at)
        if mark is None:
            return len(text)
        depth += 1 if mark.group() == "/*" else -1
        at = mark.end()
        if depth == 0:
            return at


def without_comments(text):
    """The text with comments taken out; what strings hold becomes `s`, lines stay where they are."""
    out, at = [], 0
    while token := TOKEN.search(text, at):
        out.append(text[at : token.start()])
        at = token.end()
        if token.lastgroup == "block" or token.group().startswith("/*"):
            at = block_end(text, token.start())
            out.append("\n" * text.count("\n", token.start(), at))
        elif not token.group().startswith("//"):
            # a line inside a string is a line of code
            out.append(re.sub(r"[^\n]+|(?<=\n)(?=\n)", "s", token.group()))
    out.append(text[at:])
    return "".join(out)


def item_end(code, start):
    """The end of the item, field or statement at `start`: its semicolon or comma, or its closing brace."""
    head = re.compile(r"\s*(?:pub(?:\([^)]*\))?\s+)?(\w+)").match(code, start)
    word = head.group(1) if head else ""
    braced = word not in UNBRACED
    listed = word not in UNBRACED | BLOCKS
    depth = 0
    for at in range(start, len(code)):
        c = code[at]
        if c in "({[":
            depth += 1
        elif c in ")}]":
            depth -= 1
            if depth == 0 and c == "}" and braced:
                return at + 1
        elif depth == 0 and (c == ";" or c == "," and listed):
            return at + 1
    return len(code)


def without_tests(code):
    """The code without the items under `#[cfg(test)]`, and the names of the files that are modules of tests."""
    modules, out, at = [], [], 0
    while mark := TEST.search(code, at):
        out.append(code[at : mark.start()])
        # further attributes belong to the item
        start = mark.end()
        while attribute := re.compile(r"\s*#\[").match(code, start):
            depth, start = 1, attribute.end()
            while depth:
                depth += {"[": 1, "]": -1}.get(code[start], 0)
                start += 1
        at = item_end(code, start)
        named = re.match(r"\s*(?:pub(?:\([^)]*\))?\s+)?mod\s+(\w+)\s*;", code[start:at])
        if named:
            modules.append(named.group(1))
    out.append(code[at:])
    return "".join(out), modules


def count(revision):
    """Lines of code by top folder (or file), and how many files they are in."""
    code, tests = {}, set()
    for path, text in sources(revision).items():
        code[path], modules = without_tests(without_comments(text))
        folder = re.sub(r"(?:/?mod|/?lib|/?main)?\.rs$", "", path)
        tests.update(f"{folder}/{name}".lstrip("/") for name in modules)
    lines, files = Counter(), Counter()
    for path, text in code.items():
        module = path.removesuffix(".rs").removesuffix("/mod")
        if any(module == test or module.startswith(test + "/") for test in tests):
            continue
        folder = path.split("/")[0].removesuffix(".rs")
        lines[folder] += sum(1 for line in text.splitlines() if line.strip())
        files[folder] += 1
    return lines, files


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument(
        "--rev", action="append", default=[], metavar="REVISION",
        help="a revision of git instead of the working tree; twice: both, and their difference",
    )
    revisions = parser.parse_args().rev
    if len(revisions) > 2:
        parser.error("--rev may be given at most twice")
    if len(revisions) < 2:
        lines, files = count(revisions[0] if revisions else None)
        print(f"{'folder':<14}{'files':>6}{'code':>8}")
        for folder in sorted(lines, key=lambda f: -lines[f]):
            print(f"{folder:<14}{files[folder]:>6}{lines[folder]:>8}")
        print(f"{'all':<14}{files.total():>6}{lines.total():>8}")
        return
    (before, _), (after, _) = (count(revision) for revision in revisions)
    print(f"{'folder':<14}{revisions[0][:12]:>13}{revisions[1][:12]:>13}{'change':>8}")
    for folder in sorted(before | after, key=lambda f: -max(before[f], after[f])):
        change = after[folder] - before[folder]
        print(f"{folder:<14}{before[folder]:>13}{after[folder]:>13}{change:>+8}")
    total = [before.total(), after.total()]
    print(f"{'all':<14}{total[0]:>13}{total[1]:>13}{total[1] - total[0]:>+8}")


if __name__ == "__main__":
    main()
