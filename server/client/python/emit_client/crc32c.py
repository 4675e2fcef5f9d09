# SPDX-License-Identifier: Apache-2.0
"""CRC-32C (Castagnoli, RFC 3720) with numpy.

A byte at a time, Python needs a quarter of a second for a frame. Here the message is a matrix of 32-bit words with
`_LANES` columns. The register of a CRC is linear over GF(2): moving it on by n words is a multiplication by x^(32 n)
modulo the polynomial. One row after the other is added to a row of registers, which two table look-ups move on by
`_LANES` words. The row that remains has the CRC of the whole message; it is folded in halves until one word is left.
"""
from __future__ import annotations

import numpy as np

_POLYNOMIAL = 0x82F63B78  # reflected 0x1EDC6F41
_LANES = 8192  # a power of two: the row of registers and its two tables fit into a second-level cache
_SCALAR_BYTES = 1024  # below this length, one byte at a time is faster
_SCALAR_WORDS = 16  # the last words of the fold are moved on as Python integers


def _byte_table() -> list[int]:
    table = []
    for value in range(256):
        for _ in range(8):
            value = (value >> 1) ^ (_POLYNOMIAL if value & 1 else 0)
        table.append(value)
    return table


_BYTE_TABLE = _byte_table()


def _crc_of_bytes(data: bytes, register: int) -> int:
    table = _BYTE_TABLE
    for byte in data:
        register = table[(register ^ byte) & 0xFF] ^ (register >> 8)
    return register


# An operator on the register is a list of 32 columns: the images of the bits, least significant first.
def _apply(operator: list[int], value: int) -> int:
    out = 0
    for column in operator:
        if value & 1:
            out ^= column
        value >>= 1
    return out


def _tables(operator: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Returns the images of the low and of the high 16 bits of a register."""
    halves = []
    for first in (0, 16):
        table = np.zeros(1, np.uint32)
        for bit in range(16):
            table = np.concatenate((table, table ^ np.uint32(operator[first + bit])))
        halves.append(table)
    return halves[0], halves[1]


class _Operators:
    """Operators that move a register on by 1, 2, 4 ... `_LANES` words. They are made when they are first needed."""

    def __init__(self) -> None:
        operator = [_crc_of_bytes(bytes(4), 1 << bit) for bit in range(32)]
        self.columns = {1: operator}
        words = 1
        while words < _LANES:
            operator = [_apply(operator, column) for column in operator]
            words *= 2
            self.columns[words] = operator
        self.tables = {n: _tables(columns) for n, columns in self.columns.items() if n >= _SCALAR_WORDS}


_operators: _Operators | None = None


def _shift(registers: np.ndarray, tables: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    halves = registers.view(np.uint16).reshape(-1, 2)
    return np.take(tables[0], halves[:, 0]) ^ np.take(tables[1], halves[:, 1])


def crc32c(data, crc: int = 0) -> int:
    """Returns the CRC-32C of `data`, any contiguous buffer or array.

    `crc` is the result of an earlier call, which this one continues.
    """
    global _operators
    raw = memoryview(data).cast("B") if not isinstance(data, np.ndarray) else memoryview(
        np.ascontiguousarray(data).view(np.uint8).reshape(-1))
    register = crc ^ 0xFFFFFFFF
    if len(raw) < _SCALAR_BYTES:
        return _crc_of_bytes(bytes(raw), register) ^ 0xFFFFFFFF
    if _operators is None:
        _operators = _Operators()
    words = np.frombuffer(raw, "<u4", len(raw) // 4)
    tail = bytes(raw[4 * len(words):])
    # The register of a CRC takes part in the first word of the message. Zero words in front of that change nothing.
    first = (len(words) - 1) % _LANES + 1
    row = np.zeros(_LANES, "<u4")
    row[_LANES - first:] = words[:first]
    row[_LANES - first] ^= np.uint32(register)
    tables = _operators.tables[_LANES]
    for begin in range(first, len(words), _LANES):
        row = _shift(row, tables)
        row ^= words[begin:begin + _LANES]
    while len(row) > _SCALAR_WORDS:
        half = len(row) // 2
        row = _shift(row[:half], _operators.tables[half]) ^ row[half:]
    register = 0
    for word in row.tolist():
        register = _crc_of_bytes(bytes(4), register ^ word)
    return _crc_of_bytes(tail, register) ^ 0xFFFFFFFF
