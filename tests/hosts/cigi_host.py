# SPDX-License-Identifier: Apache-2.0
"""Hosts that speak CIGI 3.3 and 4.0, written from the published layouts alone: they share no code with emitd."""
import contextlib
import select
import socket
import struct

STANDBY, OPERATE = 0, 1
SO_RCVBUFFORCE = 33  # beyond net.core.rmem_max, for root


class CigiHost:
    """Keeps the counters of both sides, and checks those of every message of the image generator."""

    def __init__(self, ig_address, order="<"):
        self.order = order
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        # Start Of Frame goes on while this host does not come to its turn. Its counter shows any that is lost.
        for option in (socket.SO_RCVBUF, SO_RCVBUFFORCE):
            with contextlib.suppress(PermissionError):
                self.socket.setsockopt(socket.SOL_SOCKET, option, 8 << 20)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(20.0)
        self.ig_address = ig_address
        self.host_frame = 0
        self.ig_frame = None
        self.texts = []
        self.answers = []

    @property
    def port(self):
        return self.socket.getsockname()[1]

    def close(self):
        self.socket.close()

    def receive(self):
        """Takes a message of the image generator. Returns its Start Of Frame as a dict."""
        data = self.socket.recv(65536)
        # Until emitd has heard of its host, it speaks 3.3.
        start, packets = self._open(data) if data[2] != 255 else self._open4(data)
        frame = start["frame"]
        if self.ig_frame is not None:
            assert frame == (self.ig_frame + 1) % 2**32, f"frame {frame} after {self.ig_frame}"
        self.ig_frame = frame
        self.answers = []
        for answer in packets:
            if isinstance(answer, str):
                self.texts.append(answer)
            else:
                self.answers.append(answer)
        return start

    def _open(self, data):
        order = "<" if data[6:8] == b"\x00\x80" else ">"
        packets, at = [], 0
        while at < len(data):
            assert data[at + 1] >= 8 and data[at + 1] % 8 == 0, f"size {data[at + 1]} at byte {at}"
            packets.append(data[at:at + data[at + 1]])
            at += data[at + 1]
        first = packets[0]
        assert first[0] == 101 and len(first) == 24 and first[2] == 3, first.hex()
        frame, ticks, last_host = struct.unpack(order + "III", first[8:20])
        start = {"database": struct.unpack("b", first[3:4])[0], "mode": first[5] & 3, "frame": frame, "ticks": ticks,
                 "last_host": last_host, "order": order, "version": 3}
        return start, [packet[4:].split(b"\0")[0].decode() if packet[0] == 117 else self._answer(order, packet)
                       for packet in packets[1:]]

    def _open4(self, data):
        order = "<" if data[:2] == b"\x18\x00" else ">"
        packets, at = [], 0
        while at < len(data):
            size, = struct.unpack_from(order + "H", data, at)
            assert size >= 8 and size % 8 == 0, f"size {size} at byte {at}"
            packets.append(data[at:at + size])
            at += size
        first = packets[0]
        assert first[2:4] == b"\xff\xff" and len(first) == 24 and first[4] == 4, first.hex()
        frame, ticks, last_host = struct.unpack_from(order + "III", first, 8)
        start = {"database": struct.unpack("b", first[5:6])[0], "mode": first[7] & 3, "frame": frame, "ticks": ticks,
                 "last_host": last_host, "order": order, "version": 4}
        return start, [self._answer4(order, packet) for packet in packets[1:]]

    def _answer4(self, order, packet):
        def read(code, at):
            return struct.unpack_from(order + code, packet, at)[0]

        kind = read("H", 2)
        if kind == 0x0FF0:
            return packet[8:].split(b"\0")[0].decode()
        if kind == 0x0FFF:
            return {"id": 102, "request": read("H", 6), "valid": bool(packet[4] & 1), "lsn": packet[4] >> 4,
                    "hot": bool(packet[4] & 2), "height_m": read("d", 8)}
        if kind == 0x0FFE:
            return {"id": 103, "request": read("H", 6), "valid": bool(packet[4] & 1), "lsn": packet[4] >> 4,
                    "hat_m": read("d", 8), "hot_m": read("d", 16), "material": read("I", 24),
                    "azimuth_deg": read("f", 28), "elevation_deg": read("f", 32)}
        if kind == 0x0FFD:
            return {"id": 104, "request": read("H", 4), "valid": bool(packet[8] & 1), "lsn": packet[8] >> 4,
                    "entity": read("H", 6) if packet[8] & 2 else None, "visible": bool(packet[8] & 4),
                    "count": packet[9], "range_m": read("d", 16)}
        if kind == 0x0FFC:
            return {"id": 105, "request": read("H", 4), "valid": bool(packet[8] & 1), "lsn": packet[8] >> 4,
                    "entity": read("H", 6) if packet[8] & 2 else None, "visible": bool(packet[8] & 8),
                    "range_m": read("d", 16), "place": struct.unpack_from(order + "ddd", packet, 24),
                    "material": read("I", 52), "azimuth_deg": read("f", 56), "elevation_deg": read("f", 60)}
        if kind == 0x0FFB:
            return {"id": 106, "sensor": packet[4], "view": read("H", 6), "state": packet[5] & 3,
                    "frame": read("I", 20)}
        if kind == 0x0FFA:
            return {"id": 107, "sensor": packet[8], "view": read("H", 4), "state": packet[9] & 3,
                    "frame": read("I", 24), "entity": read("H", 6) if packet[9] & 4 else None}
        raise AssertionError(f"answer {kind:#06x}")

    def drain(self):
        """Takes the messages that have arrived, without waiting."""
        while select.select([self.socket], [], [], 0.0)[0]:
            self.receive()

    def _answer(self, order, packet):
        def read(code, at):
            return struct.unpack_from(order + code, packet, at)[0]

        out = {"id": packet[0], "request": read("H", 2), "valid": bool(packet[4] & 1), "lsn": packet[4] >> 4}
        if packet[0] == 102:
            out |= {"hot": bool(packet[4] & 2), "height_m": read("d", 8)}
        elif packet[0] == 103:
            out |= {"hat_m": read("d", 8), "hot_m": read("d", 16), "material": read("I", 24), "azimuth_deg": read("f", 28),
                    "elevation_deg": read("f", 32)}
        elif packet[0] == 104:
            out |= {"entity": read("H", 6) if packet[4] & 2 else None, "visible": bool(packet[4] & 4),
                    "range_m": read("d", 8), "count": packet[5]}
        elif packet[0] == 105:
            out |= {"entity": read("H", 6) if packet[4] & 2 else None, "visible": bool(packet[4] & 8),
                    "range_m": read("d", 8), "place": struct.unpack_from(order + "ddd", packet, 16),
                    "material": read("I", 44), "azimuth_deg": read("f", 48), "elevation_deg": read("f", 52)}
        elif packet[0] in (106, 107):
            out = {"id": packet[0], "view": read("H", 2), "sensor": packet[4], "state": packet[5] & 3,
                   "frame": read("I", 20)}
            if packet[0] == 107:
                out["entity"] = read("H", 6) if packet[5] & 4 else None
        elif packet[0] == 108:
            out = {"id": 108, "object": read("H", 2), "place": struct.unpack_from(order + "ddd", packet, 8),
                   "roll_pitch_yaw_deg": struct.unpack_from(order + "fff", packet, 32), "flags": packet[5]}
        return out

    def control(self, mode, database=0, ticks=None, skip=0):
        """Makes IG Control. `skip` numbers are left out before, as if their messages got lost."""
        self.host_frame = (self.host_frame + 1 + skip) % 2**32
        flags = mode | (0 if ticks is None else 4) | 3 << 4
        return struct.pack(self.order + "BBBbBBHIII4x", 1, 24, 3, database, flags, 0, 0x8000, self.host_frame,
                           (ticks or 0) % 2**32, self.ig_frame or 0)

    def send(self, *packets):
        self.socket.sendto(b"".join(packets), self.ig_address)

    def entity(self, entity_id, place, yaw_pitch_roll_deg=(0.0, 0.0, 0.0), state=1, parent=None, clamp=0):
        yaw, pitch, roll = yaw_pitch_roll_deg
        flags = state | (4 if parent is not None else 0) | clamp << 5
        return struct.pack(self.order + "BBHBBBBHHfffddd", 2, 48, entity_id, flags, 0, 255, 0, 0, parent or 0, roll,
                           pitch, yaw, *place)

    def height_request(self, request, kind, place, period=0, entity=None):
        return struct.pack(self.order + "BBHBBHddd", 24, 32, request, kind | (0 if entity is None else 4), period,
                           entity or 0, *place)

    def segment_request(self, request, source, destination, extended=False, destination_entity=None,
                        destination_relative=False):
        flags = extended | (4 if destination_relative else 0) | (0 if destination_entity is None else 16)
        return struct.pack(self.order + "BBHBBHddddddIBxH", 25, 64, request, flags, 0, 0, *source, *destination, 0, 0,
                           destination_entity or 0)

    def vector_request(self, request, source, azimuth_deg, elevation_deg, min_m=0.0, max_m=1e6, extended=False, entity=None,
                       response_relative=False):
        flags = extended | (0 if entity is None else 2) | (4 if response_relative else 0)
        return struct.pack(self.order + "BBHBBHffffdddIB3x", 26, 56, request, flags, 0, entity or 0, azimuth_deg,
                           elevation_deg, min_m, max_m, *source, 0, 0)

    def position_request(self, object_id, object_class=0, frame=0):
        return struct.pack(self.order + "BBHBB2x", 27, 8, object_id, 0, object_class << 1 | frame << 4)

    def sky(self, hour, minute, month, day, year):
        return struct.pack(self.order + "BBBBB3xIf", 9, 16, hour, minute, 1 | 2 | 16, month * 1000000 + day * 10000 + year,
                           0.0)

    def atmosphere(self, air_c, wind_m_s):
        return struct.pack(self.order + "BBBBffffff4x", 10, 32, 1, 50, air_c, 20000.0, wind_m_s, 0.0, 0.0, 1013.0)

    def ellipsoid(self, radius_m, flattening):
        return struct.pack(self.order + "BBB5xdd", 19, 24, 1, radius_m, flattening)

    def sensor(self, gain=0.5, level=0.5, on=True, black_hot=False, automatic=False, track=0, extended=False, noise=0.0,
               view=0, sensor=0):
        flags = on | black_hot << 1 | automatic << 3 | track << 5
        return struct.pack(self.order + "BBHBBBxffff", 17, 24, view, sensor, flags, extended, gain, level, 0.0, noise)

    def unknown(self):
        """Makes a packet that users have defined."""
        return struct.pack(self.order + "BBHI", 210, 8, 1, 2)

    def begin(self, first=None, database=1):
        """Does the handshakes of mode and database."""
        start = self.receive()
        assert start["mode"] == STANDBY and start["database"] == 0, start
        self.send(self.control(STANDBY))
        wanted = None
        for _ in range(200):
            start = self.receive()
            if start["last_host"] == self.host_frame:
                wanted = start
                break
        assert wanted is not None and wanted["mode"] == STANDBY, wanted
        self.send(self.control(OPERATE, database, ticks=first))
        start = self.wait_mode(OPERATE)
        assert start["database"] == (-database if database else 0), start
        self.send(self.control(OPERATE, 0, ticks=first))
        for _ in range(200):
            start = self.receive()
            if start["last_host"] == self.host_frame:
                break
        assert start["database"] == database, start

    def wait_mode(self, mode):
        for _ in range(200):
            start = self.receive()
            if start["mode"] == mode:
                return start
        raise AssertionError("no answer to the mode")


class CigiHost4(CigiHost):
    """The same host in version 4.0."""

    def _packet(self, kind, code, *values):
        body = struct.pack(self.order + code, *values)
        return struct.pack(self.order + "HH", len(body) + 4, kind) + body

    def control(self, mode, database=0, ticks=None, skip=0):
        self.host_frame = (self.host_frame + 1 + skip) % 2**32
        return self._packet(0x0000, "BbBBIII4x", 4, database, 0, mode | (0 if ticks is None else 4), self.host_frame,
                            self.ig_frame or 0, (ticks or 0) % 2**32)

    def entity(self, entity_id, place, yaw_pitch_roll_deg=(0.0, 0.0, 0.0), state=1, parent=None, clamp=0):
        yaw, pitch, roll = yaw_pitch_roll_deg
        return (self._packet(0x0001, "BxHH2xfffddd", (0 if parent is None else 1) | clamp << 1, entity_id, parent or 0,
                             roll, pitch, yaw, *place) +
                self._packet(0x0025, "BBHBBHBBBB", state, 255, entity_id, 0, 0, 0, 0, 0, 0, 0))

    def height_request(self, request, kind, place, period=0, entity=None):
        return self._packet(0x0017, "HHBB6xddd", request, entity or 0, kind | (0 if entity is None else 4), period, *place)

    def vector_request(self, request, source, azimuth_deg, elevation_deg, min_m=0.0, max_m=1e6, extended=False, entity=None,
                       response_relative=False):
        flags = extended | (0 if entity is None else 2) | (4 if response_relative else 0)
        return self._packet(0x0019, "HHBBB5xffffdddI4x", request, entity or 0, flags, 0, 0, azimuth_deg, elevation_deg,
                            min_m, max_m, *source, 0)

    def segment_request(self, request, source, destination, extended=False, destination_entity=None,
                        destination_relative=False):
        flags = extended | (4 if destination_relative else 0) | (0 if destination_entity is None else 16)
        return self._packet(0x0018, "HHBBHB3xddddddI4x", request, 0, flags, 0, destination_entity or 0, 0, *source,
                            *destination, 0)

    def sky(self, hour, minute, month, day, year, second=0.0):
        return self._packet(0x0008, "BxBBfIf4x", 1 | 2 | 16, hour, minute, second, month * 1000000 + day * 10000 + year,
                            0.0)

    def sensor(self, gain=0.5, level=0.5, on=True, black_hot=False, automatic=False, track=0, extended=False, noise=0.0,
               view=0, sensor=0):
        flags = on | black_hot << 1 | automatic << 3 | track << 5
        return self._packet(0x0010, "BBBxHxxffff4x", sensor, flags, extended, view, gain, level, 0.0, noise)

    def unknown(self):
        return self._packet(0x9000, "I", 2)
