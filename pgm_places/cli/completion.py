"""Completion in a shell: a script that knows the commands and their flags."""

from collections.abc import Iterable

from pgm_places.cli.command import HELP, Command

__all__ = ["completion"]

_SCRIPT = """\
[ -z "$ZSH_VERSION" ] || {{ autoload -U +X compinit bashcompinit; compinit; bashcompinit; }}
_pgm_places() {{
    local words=
    case "$COMP_CWORD ${{COMP_WORDS[1]}}" in
        "1 "*) words="{first}" ;;
{cases}
    esac
    COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _pgm_places pgm-places"""


def completion(options: Iterable[str], commands: Iterable[Command]) -> str:
    """A script for bash and zsh; where nothing of ours fits, files are offered."""
    found = {item.name: [*_flags(item), HELP] for item in commands}
    cases = (f'        *" {name}") words="{" ".join(flags)}" ;;' for name, flags in found.items())
    return _SCRIPT.format(first=" ".join([*found, *options, HELP]), cases="\n".join(cases))


def _flags(command: Command) -> list[str]:
    return [flag for item in command.parameters for flag in item.switches]
