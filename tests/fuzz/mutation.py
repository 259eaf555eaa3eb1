"""Mutations of files: of their bytes, of their lines and words, and of JSON values."""

import json
import random
import re
from typing import Any

NUMBERS = (0, 1, 127, 255, 256, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**40, 2**63 - 1, 2**64 - 1)
WORDS = (
    *("", "0", "-1", "nan", "inf", "-inf", "1e400", "1e39", "1e308", "5e-324", "1_000", "0x10"),
    *("9" * 25, "9" * 400, "9" * 5000, "true", "null", "~", "~nobody/x", "/dev/zero", "/dev/null"),
    *("\0", "\x1b[2J", "\u202e", "\ud800", "\u0661", "a" * 300, "a" * 200_000, "{", "[", '"', "'"),
    *("[" * 2000, "{a: " * 50, "a." * 50, "&a", "*a", "!!python/object:os.system", "\ufeff", ","),
    *(".", "..", "a[b", "**", "?"),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 2**31, 10**17, 10**30, 0.5, -0.0, 1e308, 5e-324, "", "\0", "1"),
    *("\x1b[2J", "\ud800", "a" * 300, [], {}, [[]], [None], {"": 0}, [0] * 1000, "../../x"),
    *(10**400, [1e308, 1e308], [-1e308, 1e308], [5e-324], [10**400, 0]),
)


def mutated_bytes(data: bytes, rng: random.Random) -> bytes:
    """The bytes with one to four changes."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(changed) + 1)
        end = min(len(changed), at + rng.choice((1, 1, 4, 16, 256)))
        change = rng.randrange(7)
        if change == 0 and at < len(changed):
            changed[at] ^= 1 << rng.randrange(8)
        elif change == 1:
            changed[at:end] = rng.randbytes(end - at)
        elif change == 2:
            del changed[at:end]
        elif change == 3:
            changed[at:at] = changed[at:end] * rng.choice((1, 2, 50))
        elif change == 4:
            size = rng.choice((1, 2, 4, 8))
            number = rng.choice(NUMBERS) % 256**size
            changed[at : at + size] = number.to_bytes(size, rng.choice(("little", "big")))
        elif change == 5:
            del changed[at:]
        else:
            other = rng.randrange(len(changed) + 1)
            changed[at:end] = changed[other : other + end - at]
    return bytes(changed)


def mutated_text(data: bytes, rng: random.Random) -> bytes:
    """Lines, words and numbers of a text changed, doubled, exchanged or left out."""
    lines = data.decode("utf-8").split("\n")
    for _ in range(rng.choice((1, 1, 2, 4))):
        at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        change = rng.randrange(7)
        numbers = list(re.finditer(r"-?\d[\d.e]*", lines[at]))
        if change == 0:
            lines.insert(at, lines[other])
        elif change == 1 and len(lines) > 1:
            del lines[at]
        elif change == 2:
            lines[at], lines[other] = lines[other], lines[at]
        elif change == 3 and numbers:
            start, end = rng.choice(numbers).span()
            lines[at] = lines[at][:start] + rng.choice(WORDS) + lines[at][end:]
        else:
            separator = rng.choice((" ", ",", "=", ":", "."))
            words = lines[at].split(separator)
            words[rng.randrange(len(words))] = rng.choice((*WORDS, *words))
            lines[at] = separator.join(words)
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def mutated_json(data: bytes, rng: random.Random) -> Any:
    """What a JSON text holds, with values exchanged, keys left out or added, or nested deeper."""
    changed = json.loads(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        places = list(_places(changed))
        holder, key = rng.choice(places)
        other_holder, other_key = rng.choice(places)
        change = rng.randrange(5)
        if change == 0:
            del holder[key]
        elif change == 1:
            holder[key] = _copied(other_holder[other_key])
        elif change == 2:
            holder[key] = _nested(holder[key], rng.choice((1, 5, 100)), rng.random() < 0.5)
        elif change == 3 and isinstance(holder, dict):
            holder[rng.choice(("", "unknown", "\x1b", key + "_"))] = _copied(rng.choice(VALUES))
        else:
            holder[key] = _copied(rng.choice(VALUES))
        if not changed:
            break
    return changed


def _copied(value: Any) -> Any:
    """A copy of JSON data; much faster than copy.deepcopy."""
    return json.loads(json.dumps(value)) if isinstance(value, dict | list) else value


def _nested(value: Any, depth: int, in_lists: bool) -> Any:
    for _ in range(depth):
        value = [value] if in_lists else {"a": value}
    return value


def _places(content: Any) -> Any:
    """Every (container, key) of JSON data."""
    open_ones = [content]
    while open_ones:
        item = open_ones.pop()
        keys = list(item) if isinstance(item, dict) else range(len(item))
        for key in keys:
            yield item, key
            if isinstance(item[key], dict | list) and item[key]:
                open_ones.append(item[key])


def json_bytes(content: Any) -> bytes:
    """JSON text; halves of characters as they are escaped."""
    return json.dumps(content).encode("ascii")
