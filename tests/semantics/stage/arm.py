"""An arm64 processor in an emulator, and a linker for one object file of Linux: what runs there is called from here."""

import struct
from dataclasses import dataclass

import numpy as np
from unicorn import UC_ARCH_ARM64, UC_MODE_ARM, Uc
from unicorn.arm64_const import (
    UC_ARM64_REG_CPACR_EL1,
    UC_ARM64_REG_D0,
    UC_ARM64_REG_SP,
    UC_ARM64_REG_X0,
    UC_ARM64_REG_X30,
)

CODE, DATA, STACK, END = range(0x10000000, 0x14000000, 0x1000000)
OUTSIDE = END + 16
"""Where memory begins and what lies there: code, arguments, the stack, where calls end, the library of C."""
SIZE = 1 << 22
LIBRARY = {
    "memset": (0xAA0003E3, 0xB4000082, 0x38001461, 0xD1000442, 0x17FFFFFD, 0xD65F03C0),
    "memcpy": (0xAA0003E3, 0xB40000A2, 0x38401424, 0x38001464, 0xD1000442, 0x17FFFFFC, 0xD65F03C0),
}
"""mov x3, x0; cbz x2, the end; (ldrb w4, [x1], 1;) strb …, [x3], 1; sub x2, x2, 1; b to cbz; ret."""
PLACES = {name: OUTSIDE + 64 * k for k, name in enumerate(LIBRARY)}
ALLOCATED, RELOCATIONS, SYMBOLS, EMPTY = 2, 4, 2, 8
"""ELF: the flag of sections in memory; types of sections with relocations, with symbols, and of those of zeros."""
PAGE, CALLS = 275, (282, 283)
"""Relocations of arm64: ADR_PREL_PG_HI21, JUMP26 and CALL26."""
OFFSETS = {277: 0, 278: 0, 284: 1, 285: 2, 286: 3, 299: 4}
"""ADD_ABS_LO12_NC and LDST8 … LDST128_ABS_LO12_NC: the power of two that the offset in the page is divided by."""


@dataclass(frozen=True, slots=True)
class Section:
    """A section of an object file: its header's fields, its bytes, where it lies in memory."""

    kind: int
    flags: int
    link: int
    info: int
    content: bytes
    address: int


def sections(code: bytes) -> list[Section]:
    """Return the sections of an object file, laid out in memory from `CODE` on."""
    (table,) = struct.unpack_from("<Q", code, 40)
    width, count = struct.unpack_from("<HH", code, 58)
    found, at = [], CODE
    for k in range(count):
        _, kind, flags, _, start, size, link, info, align, _ = struct.unpack_from(
            "<IIQQQQIIQQ", code, table + k * width
        )
        at += -at % max(align, 1)
        content = bytes(size) if kind == EMPTY else code[start : start + size]
        found.append(Section(kind, flags, link, info, content, at))
        at += size if flags & ALLOCATED else 0
    return found


def symbols(parts: list[Section]) -> tuple[list[int | str], dict[str, int]]:
    """Return the addresses of all symbols by number, its name where another file has it, and by name."""
    (table,) = (part for part in parts if part.kind == SYMBOLS)
    names = parts[table.link].content
    addresses: list[int | str] = []
    named: dict[str, int] = {}
    for name, _, _, section, value, _ in struct.iter_unpack("<IBBHQQ", table.content):
        text = names[name : names.index(0, name)].decode()
        if 0 < section < len(parts):
            named[text] = parts[section].address + value
            addresses.append(named[text])
        else:
            addresses.append(text)
    return addresses, named


def linked(word: int, kind: int, target: int, place: int) -> int:
    """Return an instruction with the address that it refers to."""
    if kind == PAGE:
        pages = (target >> 12) - (place >> 12)
        return word & 0x9F00001F | (pages & 3) << 29 | (pages >> 2 & 0x7FFFF) << 5
    if kind in CALLS:
        return word & 0xFC000000 | (target - place) // 4 & 0x3FFFFFF
    return word & ~(0xFFF << 10) | ((target & 0xFFF) >> OFFSETS[kind]) << 10


class Arm:
    """An arm64 processor with the functions of an object file in its memory.

    Parameters
    ----------
    code
        An object file of Linux for arm64, which refers to nothing but itself and `LIBRARY`.
    """

    def __init__(self, code: bytes) -> None:
        parts = sections(code)
        addresses, self.functions = symbols(parts)
        self.processor = Uc(UC_ARCH_ARM64, UC_MODE_ARM)
        for start in (CODE, DATA, STACK, END):
            self.processor.mem_map(start, SIZE)
        self.processor.reg_write(UC_ARM64_REG_CPACR_EL1, 3 << 20)  # floats
        for name, words in LIBRARY.items():
            self.processor.mem_write(PLACES[name], struct.pack(f"<{len(words)}I", *words))
        for part in parts:
            if part.flags & ALLOCATED:
                self.processor.mem_write(part.address, part.content)
        for part in parts:
            if part.kind == RELOCATIONS and parts[part.info].flags & ALLOCATED:
                for offset, info, addend in struct.iter_unpack("<QQq", part.content):
                    self._link(parts[part.info].address + offset, info & 0xFFFFFFFF, addresses[info >> 32], addend)

    def _link(self, place: int, kind: int, target: int | str, addend: int) -> None:
        if isinstance(target, str):
            target = PLACES[target]
        if kind in (PAGE, *CALLS, *OFFSETS):
            (word,) = struct.unpack("<I", self.processor.mem_read(place, 4))
            self.processor.mem_write(place, struct.pack("<I", linked(word, kind, target + addend, place)))
        else:
            assert kind in (260, 261), kind  # tables of frames, which nobody reads here

    def call(self, name: str, result: str, *arguments: np.ndarray | float | int) -> float | int | None:
        """Call a function as C does, with arrays (which then hold what it wrote), integers and floats.

        The result is `double`, `i64` or `void`.
        """
        at, arrays = DATA, []
        words: list[int] = []
        floats: list[int] = []
        stack: list[int] = []
        for argument in arguments:
            if isinstance(argument, float):
                (bits,) = struct.unpack("<Q", struct.pack("<d", argument))
                (floats if len(floats) < 8 else stack).append(bits)
                continue
            if isinstance(argument, np.ndarray):
                self.processor.mem_write(at, argument.tobytes())
                arrays.append((argument, at))
                word, at = at, at + argument.nbytes + -argument.nbytes % 16
            else:
                word = int(argument) & 0xFFFFFFFFFFFFFFFF
            (words if len(words) < 8 else stack).append(word)
        for register, bits in (*enumerate(words, UC_ARM64_REG_X0), *enumerate(floats, UC_ARM64_REG_D0)):
            self.processor.reg_write(register, bits)
        below = STACK + SIZE - 16 * (len(stack) // 2 + 1)
        self.processor.mem_write(below, struct.pack(f"<{len(stack)}Q", *stack))
        self.processor.reg_write(UC_ARM64_REG_SP, below)
        self.processor.reg_write(UC_ARM64_REG_X30, END)
        self.processor.emu_start(self.functions[name], END)
        for array, place in arrays:
            array.reshape(-1)[:] = np.frombuffer(self.processor.mem_read(place, array.nbytes), array.dtype)
        if result == "void":
            return None
        found = self.processor.reg_read(UC_ARM64_REG_X0 if result == "i64" else UC_ARM64_REG_D0)
        return struct.unpack("<q" if result == "i64" else "<d", struct.pack("<Q", found))[0]
