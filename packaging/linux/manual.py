"""Manual pages and completions from the command line's own parser: ``python packaging/linux/manual.py FOLDER``.

Writes ``man1/kochab.1`` and a page a command, ``completions/kochab.bash``, ``_kochab`` (zsh) and ``kochab.fish``.
Nothing in them is typed a second time: a new option is in all of them with the next package.
"""

import argparse
import gzip
import os
import re
import shlex
import sys
import textwrap
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from kochab.cli.main import COMMANDS, build_parser
from kochab.core import __version__


@dataclass(frozen=True)
class Command:
    """One command with its parser; ``words`` are what is typed after ``kochab``, none for the program itself."""

    words: tuple[str, ...]
    text: str
    parser: argparse.ArgumentParser
    children: tuple["Command", ...] = ()

    @property
    def actions(self) -> list[argparse.Action]:
        """Options and arguments, without the commands below this one."""
        return [a for a in self.parser._actions if not isinstance(a, argparse._SubParsersAction)]

    @property
    def options(self) -> list[argparse.Action]:
        """What starts with a dash."""
        return [a for a in self.actions if a.option_strings]

    def all(self) -> Iterator["Command"]:
        """The command and every one below it."""
        yield self
        for child in self.children:
            yield from child.all()


def the_program() -> Command:
    """Everything that can be typed: the parser of each command is asked, as ``kochab COMMAND --help`` does."""
    children = []
    for name, (_, text) in COMMANDS.items():
        whole = build_parser([name])
        children.append(_command((name,), text, _below(whole)[0].choices[name]))
    program = build_parser([])
    # The window's own word, which is read before any parser.
    program.add_argument("--language", metavar="CODE", help="open the window in this language, where it has it")
    return Command((), program.description or "", program, tuple(children))


def _command(words: tuple[str, ...], text: str, parser: argparse.ArgumentParser) -> Command:
    children = tuple(
        _command((*words, name), next((a.help or "" for a in below._choices_actions if a.dest == name), ""), child)
        for below in _below(parser)
        for name, child in below.choices.items()
    )
    return Command(words, text, parser, children)


def _below(parser: argparse.ArgumentParser) -> "list[argparse._SubParsersAction[argparse.ArgumentParser]]":
    return [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]


def help_of(command: Command, action: argparse.Action) -> str:
    """The help of one option as a person reads it, its defaults filled in."""
    return argparse.HelpFormatter(command.parser.prog)._expand_help(action) if action.help else ""


def values_of(action: argparse.Action) -> list[str]:
    """What can stand behind an option or as an argument, where that is a list: its choices, or the names registered."""
    if action.choices:
        return [str(getattr(choice, "value", choice)) for choice in action.choices]
    registry = _registries().get(action.option_strings[0] if action.option_strings else "")
    return sorted(registry) if registry else []


def _registries() -> dict[str, list[str]]:
    from kochab.attitude import ESTIMATORS
    from kochab.detection import DETECTORS
    from kochab.gear.cameras import SOURCES
    from kochab.gear.mounts import DRIVERS
    from kochab.identification import IDENTIFIERS

    named: dict[str, Iterable[str]] = {
        "--driver": DRIVERS,
        "--source": SOURCES,
        "--method": IDENTIFIERS,
        "--detector": DETECTORS,
        "--attitude": ESTIMATORS,
    }
    return {option: list(registry) for option, registry in named.items()}


# -- Manual pages ------------------------------------------------------------------------------

EXITS = {
    0: "done; all frames are solved",
    1: "a frame has no solution",
    2: "arguments or files that cannot be used, in one sentence on standard error",
    3: "measured, but in doubt (polar)",
    130: "interrupted",
}
PLACES = {
    "KOCHAB_CONFIG": "folder of settings and equipment profiles instead of ~/.config/kochab",
    "KOCHAB_CACHE": "folder of what can be made again instead of ~/.cache/kochab",
}


def man_pages(program: Command) -> dict[str, str]:
    """Name of each page -> its text."""
    pages = {"kochab.1": _page(program, [program])}
    for command in program.children:
        pages[f"kochab-{command.words[0]}.1"] = _page(command, list(command.all()))
    return pages


def _page(command: Command, parts: list[Command]) -> str:
    name = "-".join(("kochab", *command.words))
    day = time.strftime("%Y-%m-%d", time.gmtime(int(os.environ.get("SOURCE_DATE_EPOCH", time.time()))))
    lines = [f'.TH {name.upper()} 1 "{day}" "Kochab {__version__}" "Kochab"', ".ad l", ".nh", ".SH NAME"]
    lines += [f"{_roff(name)} \\- {_roff(command.text.rstrip('.') if command.words else _IN_SHORT)}", ".SH SYNOPSIS"]
    if not command.words:
        lines += [".B kochab", r"[\-\-language CODE] [FILE ...]", ".br", ".B kochab", r"[\-\-debug] COMMAND ..."]
        lines += [".SH DESCRIPTION", _roff(_INTRODUCTION), ".SH COMMANDS"]
        for child in command.children:
            lines += [".TP", f"\\fB{_roff('-'.join(('kochab', *child.words)))}\\fR(1)", _roff(child.text)]
    for part in parts:
        if part.words and (part is not parts[0] or not part.children):
            lines += _usage(part, under_its_name=part is not parts[0])
        elif part.words:
            lines += [f".B kochab {_roff(' '.join(part.words))}", "ACTION ..."]
            lines += [".SH DESCRIPTION", _roff(f"{_sentence(part.parser.description or part.text)}")]
        else:
            lines += [".SH OPTIONS", *_entries(part)]
    lines += [".SH EXIT STATUS"]
    for code, meaning in EXITS.items():
        lines += [".TP", f".B {code}", _roff(meaning)]
    lines += [".SH ENVIRONMENT"]
    for variable, meaning in PLACES.items():
        lines += [".TP", f".B {variable}", _roff(meaning)]
    if command.words:
        lines += [".SH SEE ALSO", ".BR kochab (1)"]
    return "\n".join(lines) + "\n"


_IN_SHORT = "plate solving, polar alignment and mounts"
_INTRODUCTION = (
    "Says where a camera points, what is in the frame, and how well a telescope mount is aligned, each with its"
    " uncertainty. Without a command the window opens, with the files and folders named."
)


def _usage(part: Command, under_its_name: bool) -> list[str]:
    lines = [f".SH {_roff(' '.join(part.words)).upper()}"] if under_its_name else []
    words = part.parser.format_usage().removeprefix("usage: ").split()
    lines += [_roff(" ".join(words))]
    about = part.parser.description or part.text
    if about:
        lines += [".PP" if under_its_name else ".SH DESCRIPTION", _roff(_sentence(about))]
    if part.parser.epilog:
        lines += [".PP", _roff(part.parser.epilog)]
    return [*lines, *([] if under_its_name else [".SH OPTIONS"]), *_entries(part)]


def _entries(part: Command) -> list[str]:
    lines = []
    for action in part.actions:
        shown = ", ".join(f"\\fB{_roff(option)}\\fR" for option in action.option_strings)
        if not action.option_strings or action.nargs != 0:
            shown += f" \\fI{_roff(_value_name(part, action))}\\fR"
        lines += [".TP", shown.strip(), _roff(help_of(part, action) or " ".join(values_of(action)))]
    return lines


def _value_name(part: Command, action: argparse.Action) -> str:
    shape = part.parser._get_formatter()
    default = action.dest.upper() if action.option_strings else action.dest
    return shape._format_args(action, default)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] if not re.match(r"\S+\(", text) else text


def _roff(text: str) -> str:
    """``text`` for roff: dashes that can be copied, no line that starts as a request does."""
    text = re.sub(",(?=[^ ])", r",\:", text.replace("\\", "\\e").replace("-", "\\-"))  # a long list may be broken
    text = "".join(c if ord(c) < 128 else f"\\[u{ord(c):04X}]" for c in text)
    return "\n".join(re.sub(r"^([.'])", r"\\&\1", line) for line in textwrap.wrap(text, 110, break_on_hyphens=False))


# -- Completions -------------------------------------------------------------------------------


def bash(program: Command) -> str:
    """The completion of bash: words by the command typed so far, values by the option before the cursor."""
    commands, words, values = [], [], []
    for command in program.all():
        path = " ".join(command.words)
        if command.children:
            commands.append(
                f"    {shlex.quote(path)}) echo {shlex.quote(' '.join(c.words[-1] for c in command.children))} ;;"
            )
        offered = [option for a in command.options for option in a.option_strings]
        offered += [value for a in command.actions if not a.option_strings for value in values_of(a)]
        words.append(f"    {shlex.quote(path)}) echo {shlex.quote(' '.join(offered))} ;;")
        for action in command.options:
            if found := values_of(action):
                pattern = "|".join(shlex.quote(f"{path}:{option}") for option in action.option_strings)
                values.append(f"    {pattern}) echo {shlex.quote(' '.join(found))} ;;")
    return _BASH.format(commands="\n".join(commands), words="\n".join(words), values="\n".join(values))


_BASH = """\
# bash completion for kochab; made by packaging/linux/manual.py from the command line's parser

_kochab_commands() {{
  case "$1" in
{commands}
  esac
}}

_kochab_words() {{
  case "$1" in
{words}
  esac
}}

_kochab_values() {{
  case "$1:$2" in
{values}
  esac
}}

_kochab() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} path= word below values
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    below=" $(_kochab_commands "$path") "
    case "$below" in *" $word "*) path=${{path:+$path }}$word ;; esac
  done
  values=$(_kochab_values "$path" "$before")
  if [ -n "$values" ]; then
    COMPREPLY=($(compgen -W "$values" -- "$current"))
    return
  fi
  COMPREPLY=($(compgen -W "$(_kochab_commands "$path") $(_kochab_words "$path")" -- "$current"))
}}

complete -o default -o filenames -F _kochab kochab
"""


def zsh(program: Command) -> str:
    """The completion of zsh: a function a command, each with its options and what they mean."""
    functions = []
    for command in program.all():
        rows = [_zsh_option(command, action) for action in command.options]
        name = "_".join(("_kochab", *command.words)).replace("-", "_")
        if command.children:
            listed = "\n".join(f"    {shlex.quote(f'{c.words[-1]}:{c.text}')}" for c in command.children)
            calls = "\n".join(
                f"    {c.words[-1]}) {'_'.join(('_kochab', *c.words)).replace('-', '_')} ;;" for c in command.children
            )
            rows += ["'1: :->command'", "'*:: :->rest'"]
            functions.append(_ZSH_PARENT.format(name=name, rows=" \\\n    ".join(rows), listed=listed, calls=calls))
        else:
            rows += [_zsh_argument(action) for action in command.actions if not action.option_strings]
            functions.append(f"{name}() {{\n  _arguments -s \\\n    " + " \\\n    ".join(rows) + "\n}\n")
    return "#compdef kochab\n# made by packaging/linux/manual.py from the command line's parser\n\n" + "\n".join(
        [*functions, '_kochab "$@"\n']
    )


_ZSH_PARENT = """\
{name}() {{
  local curcontext=$curcontext state line
  typeset -A opt_args
  _arguments -C \\
    {rows}
  case $state in
  command)
    local -a commands=(
{listed}
    )
    _describe command commands
    [[ {name} == _kochab ]] && _files
    ;;
  rest)
    case $line[1] in
{calls}
    esac
    ;;
  esac
}}
"""


def _zsh_option(command: Command, action: argparse.Action) -> str:
    text = re.sub(r"([\[\]:\\])", r"\\\1", help_of(command, action))
    value = ""
    if action.nargs != 0:
        found = values_of(action)
        value = f":{_zsh_word(action)}:" + (f"({' '.join(found)})" if found else "_files")
    names = action.option_strings
    if len(names) == 1:
        return shlex.quote(f"*{names[0]}[{text}]{value}")
    return "'*'{" + ",".join(names) + "}" + shlex.quote(f"[{text}]{value}")


def _zsh_argument(action: argparse.Action) -> str:
    found = values_of(action)
    return shlex.quote(f"*:{_zsh_word(action)}:" + (f"({' '.join(found)})" if found else "_files"))


def _zsh_word(action: argparse.Action) -> str:
    name = action.metavar if isinstance(action.metavar, str) else action.dest
    return re.sub(r"[:\\]", " ", name)


def fish(program: Command) -> str:
    """The completion of fish: a line an option."""
    lines = ["# fish completion for kochab; made by packaging/linux/manual.py from the command line's parser"]
    for command in program.all():
        at = _fish_place(command)
        lines += [
            f"complete -c kochab -n {shlex.quote(at)} -f -a {child.words[-1]} -d {_fish(child.text)}"
            for child in command.children
        ]
        for action in command.actions:
            words = [f"-{'l' if o.startswith('--') else 's'} {o.lstrip('-')}" for o in action.option_strings]
            found = values_of(action)
            if not words and not found:
                continue
            takes = action.nargs != 0 and bool(words)
            value = (["-x"] if found else ["-r"]) if takes else []
            value += [f"-a {shlex.quote(' '.join(found))}"] if found else []
            text = [f"-d {_fish(help_of(command, action))}"] if action.help else []
            lines.append(" ".join(["complete -c kochab -n", shlex.quote(at), *words, *value, *text]))
    return "\n".join(lines) + "\n"


def _fish_place(command: Command) -> str:
    seen = [f"__fish_seen_subcommand_from {word}" for word in command.words]
    if command.children:
        seen.append(f"not __fish_seen_subcommand_from {' '.join(child.words[-1] for child in command.children)}")
    return "; and ".join(seen)


def _fish(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def write(folder: Path) -> None:
    """All of it into ``folder``; pages are compressed without a time stamp, as Debian wants them."""
    program = the_program()
    for name in ("man1", "completions"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, text in man_pages(program).items():
        (folder / "man1" / f"{name}.gz").write_bytes(gzip.compress(text.encode(), 9, mtime=0))
    for name, text in (("kochab.bash", bash(program)), ("_kochab", zsh(program)), ("kochab.fish", fish(program))):
        (folder / "completions" / name).write_text(text)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
