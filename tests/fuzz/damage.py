"""Damage: bytes and words of a file changed at random, also within its packed parts."""

from __future__ import annotations

import gzip
import io
import zipfile
import zlib

import numpy as np

INTERESTING = bytes((0, 1, 2, 5, 6, 9, 10, 13, 14, 15, 27, 32, 34, 127, 128, 254, 255))
WORDS = (
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"-1e308",
    b"1e-320",
    b"1e999",
    b"0",
    b"-0",
    b"-1",
    b"9" * 40,
    b"9" * 5000,
    b"1_000",
    b"0x10",
    b"",
    b" ",
    b"\t",
    b"\r",
    b"\n",
    b"\r\n",
    b"\0",
    b"\x1b[31m",
    b"\x1b]0;x\x07",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\xe2\x80\xa8",
    b"#",
    b"%",
    b"'",
    b'"',
    b",",
    b";",
    b":",
    b": ",
    b"- ",
    b"[",
    b"]",
    b"{",
    b"}",
    b"[" * 300,
    b"{a: " * 200,
    b"&a",
    b"*a",
    b"&a [*a]",
    b"!!python/object:os.system",
    b"!!binary x",
    b"!!set {a}",
    b"!!timestamp 2024-99-99",
    b"2024-01-01",
    b"12:30:45",
    b"12:60:99.5",
    b"2024-05-01T12:00:00Z",
    b"9999-12-31T23:59:59.999999999Z",
    b"<<: *a",
    b"null",
    b"true",
    b"~",
    b"[1, 2]",
    b"{x: 1}",
    b'{"x": 1}',
    b"NaN",
    b"Infinity",
    b"text",
    b"gyro_x",
    b"t",
    b"t [ms]",
    b"[deg/s]",
    b"$\\frac{$",
    b"a" * 70000,
)


def damaged(content: bytes, rng: np.random.Generator, *, text: bool) -> bytes:
    """Return bytes with one change or a few; in packed files also changes of what is packed, packed again."""
    if not text and rng.random() < 0.4 and (again := _within(content, rng)) is not None:
        return again
    made = bytearray(content)
    for _ in range(int(rng.geometric(0.5))):
        _change(made, rng, text=text)
    return bytes(made)


def _change(made: bytearray, rng: np.random.Generator, *, text: bool) -> None:
    if not made:
        made += b"\n"
    at = int(rng.integers(len(made)) if rng.random() < 0.5 else rng.integers(min(len(made), 512)))
    kind = int(rng.integers(8))
    if text and kind < 4:
        kind = 8 + kind
    if kind <= 2:
        made[at] = int(rng.choice(list(INTERESTING)))
    elif kind == 3:
        made[at] ^= 1 << int(rng.integers(8))
    elif kind == 4:
        del made[at : at + int(rng.integers(1, 40))]
    elif kind == 5:
        piece = made[at : at + int(rng.integers(1, 200))]
        made[at:at] = piece
    elif kind == 6:
        made[at : at + 8] = rng.bytes(8)
    elif kind == 7 and rng.random() < 0.3:
        del made[at:]
    elif kind in (8, 9):
        _replace_word(made, at, WORDS[int(rng.integers(len(WORDS)))])
    elif kind == 10:
        lines = bytes(made).split(b"\n")
        i, j = (int(rng.integers(len(lines))) for _ in range(2))
        lines[i], lines[j] = lines[j], lines[i]
        made[:] = b"\n".join(lines)
    elif kind == 11:
        made[at:at] = WORDS[int(rng.integers(len(WORDS)))]


def _replace_word(made: bytearray, at: int, word: bytes) -> None:
    begin, end = at, at
    while begin > 0 and made[begin - 1] not in b" ,;\n\t[]{}:":
        begin -= 1
    while end < len(made) and made[end] not in b" ,;\n\t[]{}:":
        end += 1
    made[begin:end] = word


def _within(content: bytes, rng: np.random.Generator) -> bytes | None:
    """Return a packed file whose unpacked content was changed; None where it is not packed."""
    if content.startswith(b"\x1f\x8b"):
        return gzip.compress(damaged(gzip.decompress(content), rng, text=True))
    if content.startswith(b"PK"):
        made = io.BytesIO()
        with (
            zipfile.ZipFile(io.BytesIO(content)) as old,
            zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new,
        ):
            members = old.namelist()
            chosen = members[int(rng.integers(len(members)))]
            for name in members:
                inner = old.read(name)
                if name == chosen:
                    head = int(rng.integers(10, 128)) if rng.random() < 0.7 else len(inner)
                    inner = damaged(inner[:head], rng, text=bool(rng.random() < 0.3)) + inner[head:]
                new.writestr(name if rng.random() < 0.95 else name.replace("g", "\x1b"), inner)
        return made.getvalue()
    if content.startswith(b"MATLAB 5") and content[128:132] == b"\x0f\0\0\0":
        size = int.from_bytes(content[132:136], "little")
        inner = damaged(zlib.decompress(content[136 : 136 + size]), rng, text=False)
        packed = zlib.compress(inner)
        return content[:132] + len(packed).to_bytes(4, "little") + packed + content[136 + size :]
    return None
