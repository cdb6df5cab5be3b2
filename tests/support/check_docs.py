#!/usr/bin/env python3
"""What the documents say, held against what is there. Used by tests/cli/docs.sh and tests/cli/long_docs.sh.

  check_docs.py links SOURCE              every link, image and anchor of docs/ and of the texts above it leads somewhere
  check_docs.py run BIREFIT SOURCE PAGE.. the commands of pages run as they are printed, and give the figures of the page

Of a page that is run:
- Each command of a block ```sh is run, in a copy of what a clean checkout has; `birefit` is the program under test. It
  must end with code 0, or with the code that a remark behind it says: # exit code 1.
- A block ```text after it is what it prints: its lines, in their order, numbers to one unit of their last digit. A line `..`
  stands for any lines, `..` at a line's end for the rest of it.
- Every "value ± error" of prose and tables is an estimate of some fit of the page, and so is every interval in a column of
  tables whose head is "95 % interval". What other commands gave stands in the paragraph or table below a line of its own
  that begins with "<!-- elsewhere" and says which.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

NUMBER = r"[-−+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"


def text_pages(source):
    tops = [source / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    return tops + sorted((source / "docs").glob("*.md"))


def without_code(text):
    """The text with blocks of code left empty, so that lines keep their numbers, and code in lines blanked."""
    out, fence = [], None
    for line in text.split("\n"):
        mark = re.match(r"\s*(```+)", line)
        if fence:
            out.append("")
            if mark and line.strip() == fence:
                fence = None
        elif mark:
            fence = mark.group(1)
            out.append("")
        else:
            out.append("" if re.match(r"( {4}|\t)(?! *([-*]|\d+\.) )", line) else re.sub(r"`[^`]*`", lambda m: "`" + "x" * (len(m.group()) - 2) + "`", line))
    return out


def anchors(page):
    """Of headings, as GitHub and mkdocs form them alike."""
    found, fence = set(), False
    for line in page.read_text(encoding="utf-8").split("\n"):
        if line.lstrip().startswith("```"):
            fence = not fence
        heading = None if fence else re.match(r"#+ (.*)", line)
        if heading:
            slug = re.sub(r"[^\w\- ]", "", heading.group(1).strip().lower()).replace(" ", "-")
            found.add(slug)
    return found


def check_links(source):
    failures = []
    for page in text_pages(source):
        lines = without_code(page.read_text(encoding="utf-8"))
        place = page.relative_to(source)
        for number, line in enumerate(lines, 1):
            targets = re.findall(r"\]\(([^)\s]+)(?: \"[^\"]*\")?\)", line) + re.findall(r"<(?:img|a)[^>]* (?:src|href)=\"([^\"]+)\"", line)
            for target in targets:
                if re.match(r"[a-z]+:", target):
                    continue  # elsewhere: no test asks the network
                path, _, anchor = target.partition("#")
                file = (page.parent / path).resolve() if path else page
                if not file.is_relative_to(source) or not file.exists():
                    failures.append(f"{place}:{number}: {target} leads nowhere")
                elif anchor and anchor not in anchors(file):
                    failures.append(f"{place}:{number}: {target}: no heading of that name")
            # The site's Markdown takes a list only below an empty line, and asks for four spaces before what belongs to one.
            before = lines[number - 2] if number > 1 else ""
            if re.match(r"([-*]|\d+\.) ", line) and before.strip() and not re.match(r"\s*([-*]|\d+\.) |\s+|#|\|", before) and not in_list(lines, number - 2):
                failures.append(f"{place}:{number}: a list that begins right below a paragraph is none on the site: put an empty line between")
            if re.match(r" {1,3}\S", line) and not before.strip() and number > 1:
                failures.append(f"{place}:{number}: what belongs to a list stands four spaces in, below an empty line")
    return failures


def in_list(lines, index):
    while index >= 0 and lines[index].strip():
        if re.match(r"\s*([-*]|\d+\.) ", lines[index]):
            return True
        index -= 1
    return False


def to_number(word):
    return float(word.replace("−", "-"))


def unit_of(word):
    """One unit of the last digit that is printed."""
    mantissa, _, exponent = word.lower().partition("e")
    digits = len(mantissa.partition(".")[2])
    return 10.0 ** (-digits + int(exponent or 0))


def near(word, value, beside=0.0):
    """Whether the printed number is the value. Another processor sums in another order: one unit of the last digit, or beside."""
    return value is not None and abs(to_number(word) - value) <= max(1.0001 * unit_of(word), beside)


def same_line(expected, got):
    if expected.rstrip().endswith(".."):
        wanted = expected.rstrip()[:-2].split()
        words = got.split()[: len(wanted)]
    else:
        wanted, words = expected.split(), got.split()
    if len(wanted) != len(words):
        return False
    for a, b in zip(wanted, words):
        parts_a, parts_b = re.split(f"({NUMBER})", a), re.split(f"({NUMBER})", b)
        if len(parts_a) != len(parts_b) or parts_a[::2] != parts_b[::2]:
            return False
        if not all(near(x, to_number(y)) for x, y in zip(parts_a[1::2], parts_b[1::2])):
            return False
    return True


def check_output(expected, output):
    """The first expected line that the output lacks; None if it has all."""
    lines, at, anywhere = output.split("\n"), 0, True
    for line in expected.rstrip("\n").split("\n"):
        if line.strip() == "..":
            anywhere = True
            continue
        found = next((i for i in range(at, len(lines)) if same_line(line, lines[i])), None)
        if found is None or (not anywhere and found != at):
            return line
        at, anywhere = found + 1, False
    return None


def blocks(text):
    """(language, first line's number, content) of the blocks of code."""
    language, start, content = None, 0, []
    for number, line in enumerate(text.split("\n"), 1):
        mark = re.match(r"```(\w*)", line)
        if language is None and mark:
            language, start, content = mark.group(1), number + 1, []
        elif language is not None and line.rstrip() == "```":
            yield language, start, "\n".join(content)
            language = None
        elif language is not None:
            content.append(line)


def commands(content):
    for line in content.replace("\\\n", " ").split("\n"):
        if line.strip() and not line.startswith("#"):
            code = re.search(r"# exit code (\d+)", line)
            yield line, int(code.group(1)) if code else 0


def estimates(work):
    """(value, error, low, high) of every parameter of every fit that is there."""
    for file in work.glob("out/**/fit.json"):
        for parameter in json.loads(file.read_text())["parameters"].values():
            interval = parameter["interval_95"] or (None, None)
            yield parameter["value"], parameter["stderr"], *interval


def check_figures(page, text, work):
    known = list(estimates(work))
    failures, elsewhere, interval_column, before = [], False, None, ""
    for number, line in enumerate(without_code(text), 1):
        if line.startswith("<!-- elsewhere"):
            elsewhere, before = True, ""
            continue
        if not line.strip():
            interval_column = None
            elsewhere = elsewhere and not before.strip()
        before = line
        if elsewhere:
            continue
        for value, error in re.findall(rf"({NUMBER}) ?(?:±|\+-|\+/-) ?({NUMBER})", line):
            # A search ends within a small part of the error.
            if not any(v is not None and e is not None and near(value, v, 0.05 * e) and near(error, e, 0.05 * e) for v, e, _, _ in known):
                failures.append(f"{page}:{number}: no fit of the page gives {value} ± {error}")
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")] if line.startswith("|") else []
        if interval_column is None and any("95 % interval" in cell for cell in cells):
            interval_column = next(i for i, cell in enumerate(cells) if "95 % interval" in cell)
        elif interval_column is not None and interval_column < len(cells):
            ends = re.fullmatch(rf"({NUMBER})(?: ?– ?| ?\.\. ?| to )({NUMBER})[^\d]*", cells[interval_column])
            if ends and not any(near(ends.group(1), low, 0.1 * e) and near(ends.group(2), high, 0.1 * e) for _, e, low, high in known if low is not None):
                failures.append(f"{page}:{number}: no fit of the page has the interval {ends.group(0)}")
    return failures


def run_page(program, source, page, work):
    text = page.read_text(encoding="utf-8")
    failures, output, ran = [], "", 0
    environment = dict(os.environ, PATH=f"{work / 'build/release'}{os.pathsep}{os.environ['PATH']}")
    for language, start, content in blocks(text):
        if language == "sh":
            output = ""
            for command, code in commands(content):
                result = subprocess.run(["bash", "-o", "pipefail", "-c", command], cwd=work, env=environment, capture_output=True, text=True)
                ran += 1
                output += result.stdout + result.stderr
                if result.returncode != code:
                    failures.append(f"{page.name}:{start}: exit code {result.returncode} of: {command}\n{result.stderr}")
        elif language == "text":
            missing = check_output(content, output)
            if missing is not None:
                failures.append(f"{page.name}:{start}: not printed: {missing}\nbut:\n{output}")
    if not ran:
        failures.append(f"{page.name}: has no command to run (a block ```sh)")
    return failures + check_figures(page.name, text, work)


def run(program, source, names):
    failures = []
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            work = pathlib.Path(folder)
            for part in ("docs", "fit_configs"):
                shutil.copytree(source / part, work / part)
            (work / "tools").symlink_to(source / "tools")
            (work / "data").symlink_to(source / "data")
            (work / "build/release").mkdir(parents=True)
            (work / "build/release/birefit").symlink_to(program)
            failures += run_page(program, source, work / "docs" / name, work)
    return failures


def main(arguments):
    if arguments[:1] == ["links"] and len(arguments) == 2:
        failures = check_links(pathlib.Path(arguments[1]).resolve())
    elif arguments[:1] == ["run"] and len(arguments) > 3:
        failures = run(pathlib.Path(arguments[1]).resolve(), pathlib.Path(arguments[2]).resolve(), arguments[3:])
    else:
        sys.exit(__doc__)
    for failure in failures:
        print("FAIL", failure)
    print(f"{len(failures)} failures" if failures else "all as required")
    return len(failures) > 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
