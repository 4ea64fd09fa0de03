"""Manual pages and completions against the command line itself: nothing that can be typed is absent from them."""

import argparse
import re
import shutil
import subprocess

import pytest

from kochab.cli.main import COMMANDS, build_parser


@pytest.fixture(scope="module")
def manual(packaged):
    return packaged("linux/manual.py")


@pytest.fixture(scope="module")
def program(manual):
    return manual.the_program()


def typed() -> dict[tuple[str, ...], set[str]]:
    """Command -> its options, walked here, not by what is tested."""
    found: dict[tuple[str, ...], set[str]] = {}

    def walk(words: tuple[str, ...], parser: argparse.ArgumentParser) -> None:
        found[words] = set()
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, child in action.choices.items():
                    walk((*words, name), child)
            else:
                found[words] |= set(action.option_strings)

    for name in COMMANDS:
        whole = build_parser([name])
        (below,) = [a for a in whole._actions if isinstance(a, argparse._SubParsersAction)]
        walk((name,), below.choices[name])
    return found


def test_every_command_and_option_is_in_its_manual_page(manual, program):
    pages = manual.man_pages(program)
    assert len(typed()) > 35
    for words, options in typed().items():
        page = pages[f"kochab-{words[0]}.1"].replace("\\-", "-")
        part = page if len(words) == 1 else page.split(f".SH {' '.join(words).upper()}\n")[1].split(".SH ")[0]
        for option in options:
            assert re.search(rf"\\fB{re.escape(option)}\\fR", part), (words, option)
        assert f"kochab-{words[0]}" in pages["kochab.1"].replace("\\-", "-")


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_every_command_and_option_is_in_the_completion_of(shell, manual, program):
    text = getattr(manual, shell)(program)
    for words, options in typed().items():
        if shell == "zsh":
            part = text.split(f"{'_'.join(('_kochab', *words)).replace('-', '_')}() {{")[1].split("\n}\n")[0]
            part = re.sub(r"\{([^}]*)\}", lambda m: f"*{m[1].replace(',', '[ *')}[", part)
            found = set(re.findall(r"\*(--?[a-zA-Z-]+)\[", part))
        else:
            place = "; and ".join(f"__fish_seen_subcommand_from {word}" for word in words)
            lines = [line for line in text.splitlines() if re.search(rf"-n '?{place}(;|'|$)", line)]
            found = {
                f"-{name}" if kind == "s" else f"--{name}"
                for line in lines
                for kind, name in re.findall(r" -([ls]) (\S+)", re.sub(r"-d '.*", "", line))
            }
        assert options <= found, (words, options - found)


@pytest.mark.skipif(not shutil.which("bash"), reason="no bash here")
def test_bash_completes_every_command_and_option(manual, program, tmp_path):
    script = tmp_path / "kochab.bash"
    script.write_text(manual.bash(program))
    asked = [("", [""])]
    asked += [(" ".join(words), ["--"]) for words in typed()]
    lines = [f"source {script}"]
    for path, (current,) in asked:
        words = ["kochab", *path.split(), current]
        lines += [f"COMP_WORDS=({' '.join(w or chr(39) * 2 for w in words)}); COMP_CWORD={len(words) - 1}; COMPREPLY=()",
                  '_kochab; echo "${COMPREPLY[*]}"']  # fmt: skip
    done = subprocess.run(["bash", "-u", "-c", "\n".join(lines)], capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    first, *others = done.stdout.splitlines()
    assert set(COMMANDS) <= set(first.split())
    for (words, options), line in zip(typed().items(), others, strict=True):
        assert {o for o in options if o.startswith("--")} <= set(line.split()), words


def test_values_are_offered_where_they_are_known(manual, program):
    every = {" ".join(c.words): c for c in program.all()}
    values = {o: manual.values_of(a) for c in every.values() for a in c.options for o in a.option_strings}
    assert {"lx200", "onstep"} <= set(values["--driver"])
    assert {"patterns", "voting"} <= set(values["--method"])
    assert values["--epoch"] == ["J2000", "date"]
    assert {"now", "power-on", "eqmod"} == set(values["--home"])


@pytest.mark.skipif(not shutil.which("groff"), reason="no groff here")
def test_groff_has_no_complaint_about_a_page(manual, program):
    for name, page in manual.man_pages(program).items():
        done = subprocess.run(["groff", "-ww", "-man", "-Tascii"], input=page, capture_output=True, text=True)
        assert done.stderr == "", name
