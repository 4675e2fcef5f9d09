#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads messages of CIGI 4.0 without the library, from the tables of the packets below.

Usage: cigi4_judge.py check host|ig FILE   compares a message with the sample values, field by field
       cigi4_judge.py golden               prints the sample packets as hexadecimal bytes, big and little endian

A row of a packet is: offset, code of the struct module, value. A row with bits is: offset, (first bit, number of
bits), value; bits are counted from the least significant one of a byte, or of a word where `w` marks one. Bytes
without a row are reserved and must be 0. `check` exits with 1 and names each difference.
"""
import struct
import sys

HOST = [
    ("IG Control", 0x0000, 24, [
        (4, "B", 4), (5, "b", 5), (6, (0, 1), 1), (7, (0, 2), 1), (7, (2, 1), 1), (7, (3, 1), 1), (7, (4, 4), 0),
        (8, "I", 0x01020304), (12, "I", 0x090A0B0C), (16, "I", 0x05060708)]),
    ("Component Control", 0x0003, 40, [
        (4, "H", 0x0102), (6, (0, 6), 13), (7, "B", 9), (8, "H", 0x0304), (16, "I", 0x11121314), (20, "I", 0x21222324),
        (24, "I", 0x31323334), (28, "I", 0x41424344), (32, "I", 0x51525354), (36, "I", 0x61626364)]),
    ("Short Component Control", 0x0004, 24, [
        (4, "H", 0x0506), (6, (0, 6), 3), (7, "B", 8), (8, "H", 0x0708), (16, "I", 0x71727374), (20, "I", 0x81828384)]),
    ("Articulated Part Control", 0x0005, 32, [
        (4, "H", 0x0203), (6, "B", 4), (7, (0, 1), 1), (7, (1, 1), 0), (7, (2, 1), 1), (7, (3, 1), 0), (7, (4, 1), 0),
        (7, (5, 1), 1), (7, (6, 1), 0), (8, "f", 1.5), (12, "f", -2.5), (16, "f", 3.5), (20, "f", -170.0),
        (24, "f", 80.0), (28, "f", 350.0)]),
    ("Short Articulated Part Control", 0x0006, 24, [
        (4, "H", 0x0405), (6, "B", 6), (7, "B", 7), (8, (0, 3), 3), (8, (3, 3), 5), (8, (6, 1), 1), (8, (7, 1), 0),
        (12, "f", -4.5), (16, "f", 45.0)]),
    ("Velocity Control", 0x0007, 32, [
        (4, "H", 0x0607), (6, "B", 8), (7, (0, 1), 0), (7, (1, 1), 1), (8, "f", 100.5), (12, "f", -200.5),
        (16, "f", 300.5), (20, "f", -10.25), (24, "f", 20.25), (28, "f", -30.25)]),
    ("Celestial Sphere Control", 0x0008, 24, [
        (4, (0, 1), 0), (4, (1, 1), 1), (4, (2, 1), 1), (4, (3, 1), 0), (4, (4, 1), 1), (6, "B", 13), (7, "B", 47),
        (8, "f", 56.5), (12, "I", 2292024), (16, "f", 62.5)]),
    ("Atmosphere Control", 0x0009, 32, [
        (4, (0, 7), 55), (4, (7, 1), 1), (8, "f", -12.5), (12, "f", 23000.0), (16, "f", 8.5), (20, "f", -0.5),
        (24, "f", 275.0), (28, "f", 1013.25)]),
    ("Environmental Region Control", 0x000A, 48, [
        (4, (0, 2), 1), (4, (2, 1), 0), (4, (3, 1), 1), (4, (4, 1), 1), (4, (5, 1), 0), (6, "H", 0x0708),
        (8, "d", 47.5), (16, "d", -122.25), (24, "f", 5000.0), (28, "f", 6000.0), (32, "f", 700.0), (36, "f", -45.0),
        (40, "f", 80.5)]),
    ("Weather Control", 0x000B, 72, [
        (4, "B", 2), (5, "B", 90), (6, (0, 1), 1), (6, (1, 1), 0), (6, (2, 1), 1), (6, (3, 1), 0), (6, (4, 4), 7),
        (7, (0, 2), 1), (7, (2, 3), 4), (7, (5, 1), 1), (8, "H", 0x090A), (12, "f", -5.5), (16, "f", 1500.0),
        (20, "f", 12.5), (24, "f", 87.5), (28, "f", 1200.0), (32, "f", 400.0), (36, "f", 50.0), (40, "f", 9.5),
        (44, "f", -1.5), (48, "f", -50.0), (52, "f", 850.5), (56, "f", 0.25), (60, "f", 37.5), (64, "f", 75.0)]),
    ("View Control", 0x000F, 40, [
        (4, "B", 13), (5, (0, 1), 1), (5, (1, 1), 0), (5, (2, 1), 0), (5, (3, 1), 1), (5, (4, 1), 0), (5, (5, 1), 1),
        (6, "H", 0x0B0C), (8, "H", 0x0E0F), (12, "f", 0.5), (16, "f", -0.25), (20, "f", 0.125), (24, "f", 1.5),
        (28, "f", -2.5), (32, "f", -3.5)]),
    ("Sensor Control", 0x0010, 32, [
        (4, "B", 18), (5, (0, 1), 1), (5, (1, 1), 1), (5, (2, 1), 0), (5, (3, 1), 1), (5, (4, 1), 0), (5, (5, 3), 3),
        (6, (0, 1), 1), (8, "H", 0x1011), (12, "f", 0.75), (16, "f", 0.25), (20, "f", 16.5), (24, "f", 0.125)]),
    ("Earth Reference Model Definition", 0x0012, 24, [
        (4, (0, 1), 1), (8, "d", 6378137.0), (16, "d", 0.0033528106647474805)]),
    ("View Definition", 0x0014, 40, [
        (4, "H", 0x1213), (6, "B", 20), (7, (0, 1), 1), (7, (1, 1), 0), (7, (2, 1), 1), (7, (3, 1), 1), (7, (4, 1), 0),
        (7, (5, 1), 1), (7, (6, 2), 2), (8, (0, 3), 2), (8, (3, 1), 0), (8, (4, 1), 1), (8, (5, 3), 2), (12, "f", 0.5),
        (16, "f", 40000.0), (20, "f", -1.5), (24, "f", 1.25), (28, "f", 0.75), (32, "f", -0.625)]),
    ("HAT/HOT Request", 0x0017, 40, [
        (4, "H", 0x1415), (6, "H", 0x1718), (8, (0, 2), 2), (8, (2, 1), 1), (9, "B", 22), (16, "d", 10.5),
        (24, "d", -20.5), (32, "d", 30.5)]),
    ("Line of Sight Segment Request", 0x0018, 72, [
        (4, "H", 0x191A), (6, "H", 0x1C1D), (8, (0, 1), 1), (8, (1, 1), 0), (8, (2, 1), 1), (8, (3, 1), 0),
        (8, (4, 1), 1), (9, "B", 27), (10, "H", 0x2324), (12, "B", 34), (16, "d", 1.25), (24, "d", -2.25),
        (32, "d", 3000.25), (40, "d", 400.5), (48, "d", -500.5), (56, "d", 600.5), (64, "I", 0x1E1F2021)]),
    ("Line of Sight Vector Request", 0x0019, 64, [
        (4, "H", 0x2526), (6, "H", 0x2829), (8, (0, 1), 1), (8, (1, 1), 0), (8, (2, 1), 1), (9, "B", 39), (10, "B", 46),
        (16, "f", -120.5), (20, "f", 33.25), (24, "f", 10.0), (28, "f", 9000.0), (32, "d", 51.5), (40, "d", 7.75),
        (48, "d", 88.125), (56, "I", 0x2A2B2C2D)]),
    ("Position Request", 0x001A, 8, [
        (4, "B", 49), (5, (0, 1), 1), (5, (1, 3), 1), (5, (4, 2), 2), (6, "H", 0x2F30)]),
    ("Environmental Conditions Request", 0x001B, 32, [
        (4, (0, 1), 0), (4, (1, 1), 1), (4, (2, 1), 1), (4, (3, 1), 0), (5, "B", 50), (8, "d", -33.5),
        (16, "d", 151.25), (24, "d", 20.75)]),
    ("Entity Position", 0x0001, 48, [
        (4, (0, 1), 1), (4, (1, 2), 1), (6, "H", 0x1122), (8, "H", 0x5566), (12, "f", -12.5), (16, "f", 7.25),
        (20, "f", 271.5), (24, "d", -1.5), (32, "d", 2000.25), (40, "d", -3.75)]),
    ("Entity Control", 0x0025, 16, [
        (4, (0, 2), 1), (4, (2, 1), 1), (4, (3, 1), 0), (4, (4, 1), 1), (4, (5, 1), 1), (5, "B", 200),
        (6, "H", 0x1122), (8, "B", 1), (9, "B", 2), (10, "H", 225), (12, "B", 3), (13, "B", 4), (14, "B", 5),
        (15, "B", 6)]),
    ("Animation Control", 0x0026, 16, [
        (4, (0, 1), 1), (4, (1, 1), 0), (4, (2, 1), 1), (4, (3, 1), 0), (5, "B", 201), (6, "H", 0x3132),
        (8, "H", 0x3334), (12, "f", -1.75)]),
    ("Acceleration Control", 0x0013, 32, [
        (4, "H", 0x3536), (6, "B", 55), (7, (0, 1), 1), (7, (1, 1), 0), (8, "f", -9.75), (12, "f", 10.5),
        (16, "f", -11.25), (20, "f", 12.5), (24, "f", -13.5), (28, "f", 14.5)]),
]

IG = [
    ("Start Of Frame", 0xFFFF, 24, [
        (4, "B", 4), (5, "b", -5), (7, (0, 2), 1), (7, (2, 1), 1), (7, (3, 1), 1), (7, (4, 4), 0), (8, "I", 0x34353637),
        (12, "I", 0x38393A3B), (16, "I", 0x3C3D3E3F), (20, ("w", 8, 1), 1), (20, ("w", 9, 1), 0), (20, ("w", 10, 1), 1)]),
    ("HAT/HOT Response", 0x0FFF, 16, [
        (4, (0, 1), 1), (4, (1, 1), 1), (4, (4, 4), 10), (6, "H", 0x4041), (8, "d", -42.5)]),
    ("HAT/HOT Extended Response", 0x0FFE, 40, [
        (4, (0, 1), 1), (4, (4, 4), 11), (6, "H", 0x4243), (8, "d", 120.25), (16, "d", -7.5), (24, "I", 0x44454647),
        (28, "f", -90.5), (32, "f", 89.5)]),
    ("Line of Sight Response", 0x0FFD, 24, [
        (4, "H", 0x4849), (6, "H", 0x4B4C), (8, (0, 1), 1), (8, (1, 1), 0), (8, (2, 1), 1), (8, (4, 4), 12),
        (9, "B", 74), (16, "d", 1234.5)]),
    ("Line of Sight Extended Response", 0x0FFC, 64, [
        (4, "H", 0x4D4E), (6, "H", 0x5051), (8, (0, 1), 1), (8, (1, 1), 1), (8, (2, 1), 1), (8, (3, 1), 0),
        (8, (4, 4), 13), (9, "B", 79), (16, "d", 4321.5), (24, "d", -11.25), (32, "d", 222.5), (40, "d", -3.125),
        (48, "B", 82), (49, "B", 83), (50, "B", 84), (51, "B", 85), (52, "I", 0x56575859), (56, "f", 170.25),
        (60, "f", -45.75)]),
    ("Sensor Response", 0x0FFB, 24, [
        (4, "B", 92), (5, (0, 2), 1), (6, "H", 0x5A5B), (8, "H", 0x5D5E), (10, "H", 0x5F60), (12, "f", -0.375),
        (16, "f", 0.875), (20, "I", 0x61626364)]),
    ("Sensor Extended Response", 0x0FFA, 56, [
        (4, "H", 0x6566), (6, "H", 0x6869), (8, "B", 103), (9, (0, 2), 2), (9, (2, 1), 1), (12, "H", 0x6A6B),
        (14, "H", 0x6C6D), (16, "f", 1.375), (20, "f", -1.875), (24, "I", 0x6E6F7071), (32, "d", 60.5),
        (40, "d", -170.5), (48, "d", 9000.5)]),
    ("Position Response", 0x0FF9, 48, [
        (4, "B", 116), (5, (0, 3), 2), (5, (3, 2), 1), (6, "H", 0x7273), (8, "d", 1.5), (16, "d", -2.5), (24, "d", 3.5),
        (32, "f", -4.5), (36, "f", 5.5), (40, "f", 65.5)]),
    ("Weather Conditions Response", 0x0FF8, 32, [
        (4, "B", 117), (5, "B", 44), (8, "f", 21.5), (12, "f", 18000.0), (16, "f", 3.5), (20, "f", 0.75),
        (24, "f", 185.0), (28, "f", 998.5)]),
    ("Event Notification", 0x0FF1, 24, [
        (4, "H", 0x7677), (8, "I", 0x78797A7B), (12, "I", 0x7C7D7E7F), (16, "I", 0x80818283)]),
    ("Image Generator Message", 0x0FF0, 24, [
        (4, "H", 0x8485), (8, "11s", b"hello, host")]),
]


def value_of(packet, offset, code, order):
    if isinstance(code, str):
        return struct.unpack_from(order + code, packet, offset)[0]
    if code[0] == "w":
        word = struct.unpack_from(order + "H", packet, offset)[0]
        return (word >> code[1]) & ((1 << code[2]) - 1)
    return (packet[offset] >> code[0]) & ((1 << code[1]) - 1)


def encode(packet_id, size, rows, order):
    out = bytearray(size)
    struct.pack_into(order + "HH", out, 0, size, packet_id)
    for offset, code, value in rows:
        if isinstance(code, str):
            struct.pack_into(order + code, out, offset, value)
        elif code[0] == "w":
            word = struct.unpack_from(order + "H", out, offset)[0] | value << code[1]
            struct.pack_into(order + "H", out, offset, word)
        else:
            out[offset] |= value << code[0]
    return bytes(out)


def check(table, message):
    order = "<" if message[:2] == b"\x18\x00" else ">"
    faults = []
    at = 0
    for name, packet_id, size, rows in table:
        if len(message) - at < 4:
            return faults + [f"{name}: the message ends before it"]
        stated, found = struct.unpack_from(order + "HH", message, at)
        if (stated, found) != (size, packet_id):
            return faults + [f"{name}: size {stated}, id {found:#06x}"]
        packet = message[at:at + stated]
        for offset, code, value in rows:
            got = value_of(packet, offset, code, order)
            if got != value:
                faults.append(f"{name}: offset {offset} {code} is {got}, must be {value}")
        if packet != encode(packet_id, size, rows, order):
            faults.append(f"{name}: {packet.hex()} has reserved bits")
        at += stated
    if at != len(message):
        faults.append(f"{len(message) - at} bytes are left")
    return faults


def main():
    if sys.argv[1:] == ["golden"]:
        for name, packet_id, size, rows in HOST + IG:
            print(name, encode(packet_id, size, rows, ">").hex(), encode(packet_id, size, rows, "<").hex())
        return 0
    if len(sys.argv) != 4 or sys.argv[1] != "check" or sys.argv[2] not in ("host", "ig"):
        print(__doc__, file=sys.stderr)
        return 2
    with open(sys.argv[3], "rb") as file:
        message = file.read()
    faults = check(HOST if sys.argv[2] == "host" else IG, message)
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
