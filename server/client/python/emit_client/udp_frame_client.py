# SPDX-License-Identifier: Apache-2.0
"""Frames as UDP fragments."""
from __future__ import annotations

import ipaddress
import select
import socket
import struct
import time

import numpy as np

from .control import RECORD_RESEND, ControlConnection, encode_record
from .deadline import wait_for
from .errors import ArgumentError, ClosedError, ConnectError
from .frame_client import StreamTerms, SubscribeOptions
from .frame_header import FLAG_BITS
from .frames import ReceiveCounters, ReceivedFrame
from .messages import control_pb2
from .reassembler import Reassembler
from .resend_planner import MAX_RESEND_RANGES, ResendPlanner, encode_resend
from .server_info import Channel
from .socket_frame_client import SocketFrameClient

_SO_RXQ_OVFL = 40
_SO_RCVBUFFORCE = 33
_UDP_GRO = 104
_MESSAGE_BYTES = 65536
_CONTROL_BYTES = socket.CMSG_SPACE(4) * 2
# A frame whose last fragment was lost is handed out when nothing more comes for this long.
_QUIET_NS = 250_000_000
# What lies in the socket at the deadline is still taken, but a flood of datagrams holds the caller no longer than this.
_GRACE_NS = 100_000_000
_NO_FAULT = ("accepted", "duplicate", "late", "foreign")


class UdpFrameClient(SocketFrameClient):
    """Receives frames over UDP; the control connection stays open beside it.

    The kernel joins consecutive datagrams (UDP_GRO), which are then put in place with one copy.
    """

    def __init__(self, connection: ControlConnection, check_crc: bool) -> None:
        super().__init__(connection, check_crc)
        self._socket: socket.socket | None = None
        self._peer_ip = _plain_ip(connection.peer_ip)
        self._buffer = np.empty(_MESSAGE_BYTES, np.uint8)
        self._reassembler: Reassembler
        self._planner = ResendPlanner()
        self._known_sources: dict[str, bool] = {}
        self._quiet_since_ns = 0
        self._first_byte_ns = 0
        self._buffer_bytes = 0
        self._largest_bytes = 0
        self._strangers = 0  # datagrams that did not come from the daemon
        self._end: ClosedError | None = None

    def _close(self) -> None:
        super()._close()
        if self._socket is not None:
            self._socket.close()

    @property
    def counters(self) -> ReceiveCounters:
        counters = self._account.counters
        if self._subscribed:
            fragments = self._reassembler.fragments
            counters.bad_datagrams = fragments.total() - sum(fragments[each] for each in _NO_FAULT)
            counters.foreign_datagrams = fragments["foreign"] + self._strangers
            counters.resent = self._reassembler.resent
        return counters

    @property
    def receive_buffer_bytes(self) -> int:
        return self._buffer_bytes

    @property
    def receive_buffer_advice(self) -> str:
        needed = 4 * self._largest_bytes
        if self._buffer_bytes >= needed:
            return ""
        return (f"the receive buffer holds {self._buffer_bytes} bytes, four frames need {needed}: sysctl -w"
                f" net.core.rmem_max={2 * needed}")

    def _subscribe(self, options: SubscribeOptions, end_ns: int) -> Channel:
        self._largest_bytes = self._largest_frame_bytes()
        self._socket = self._open_socket(options)
        self._size_buffer(8 * self._largest_bytes)  # four are needed; the rest is headroom
        udp_port = self._socket.getsockname()[1]
        answer = self._request(
            options, end_ns, udp_port=udp_port, fragment_payload_bytes=options.fragment_payload_bytes,
            multicast_group=options.multicast_group, resend=options.resend,
            # Present and 0: none. An absent wish would leave it to the daemon.
            error_correction=control_pb2.ErrorCorrection(data_fragments=0, parity_fragments=0))
        channel = self._take_terms(options, answer, resend=answer.resend, udp_port=udp_port,
                                   fragment_payload_bytes=answer.fragment_payload_bytes)
        self._reassembler = Reassembler(
            self._stream_id, self._largest_bytes, check_crc=self._check_crc, max_open=4 if self.terms.resend else 2,
            wait_for_missing=self.terms.resend)
        return channel

    def _open_socket(self, options: SubscribeOptions) -> socket.socket:
        family = self._connection.family
        address = "::" if family == socket.AF_INET6 else "0.0.0.0"
        group = None
        if options.multicast_group:
            try:
                group = ipaddress.ip_address(options.multicast_group)
            except ValueError:
                pass
            if group is None or not group.is_multicast:
                raise ArgumentError(f"'{options.multicast_group}' is not a multicast group")
            family = socket.AF_INET6 if group.version == 6 else socket.AF_INET
            address = str(group)
        receiver = socket.socket(family, socket.SOCK_DGRAM)
        try:
            receiver.setblocking(False)
            if group is not None:
                receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiver.bind((address, options.udp_port))
            if group is not None:
                self._join(receiver, group)
            receiver.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
            try:
                receiver.setsockopt(socket.IPPROTO_UDP, _UDP_GRO, 1)
            except OSError:
                pass  # An older kernel gives the datagrams one by one.
        except OSError as error:
            receiver.close()
            raise ConnectError(f"udp {address}:{options.udp_port}: {error.strerror}") from error
        return receiver

    def _join(self, receiver: socket.socket, group: ipaddress.IPv4Address | ipaddress.IPv6Address) -> None:
        """Joins the group on the interface by which this client reaches emitd."""
        local = self._connection.local_address
        if group.version == 4:
            interface = ipaddress.ip_address(_plain_ip(local[0])).packed
            if len(interface) != 4:
                interface = bytes(4)  # The kernel chooses: the control connection has an address of another family.
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group.packed + interface)
        else:
            membership = group.packed + struct.pack("@I", _interface_index(local[0]))
            receiver.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, membership)

    def _size_buffer(self, wanted_bytes: int) -> None:
        wanted_bytes = min(max(wanted_bytes, 1 << 20), (1 << 30) - 1)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, wanted_bytes)
        except OSError:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, wanted_bytes)
        # The kernel reports twice the number in the unit of net.core.rmem_max.
        self._buffer_bytes = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2

    def _receive(self, end_ns: int) -> ReceivedFrame | None:
        while True:
            frame = self._pop()
            if frame is not None:
                return frame
            if self._end is not None:
                raise self._end
            if self._take():
                self._quiet_since_ns = 0
                if time.monotonic_ns() > end_ns + _GRACE_NS:
                    return self._pop()
                continue
            # The socket is empty, so what is missing is not waiting there.
            ask_ns = self._ask_for_missing() if self.terms.resend else 0
            now_ns = time.monotonic_ns()
            if self._quiet_since_ns == 0:
                self._quiet_since_ns = now_ns
            elif now_ns - self._quiet_since_ns > _QUIET_NS:
                self._quiet_since_ns = now_ns
                self._reassembler.flush()
                continue
            wake_ns = min(end_ns, self._quiet_since_ns + _QUIET_NS + 1_000_000)
            if ask_ns:
                wake_ns = min(wake_ns, ask_ns)
            if self._connection.has_pending():
                wake_ns = now_ns
            ready = wait_for({self._socket.fileno(): select.POLLIN, self._connection.fileno(): select.POLLIN}, wake_ns)
            if self._connection.fileno() in ready or self._connection.has_pending():
                self._read_control()
            if self._socket.fileno() not in ready and self._end is None and time.monotonic_ns() >= end_ns:
                return self._pop()

    def _read_control(self) -> None:
        try:
            record = self._connection.receive(time.monotonic_ns())
        except ClosedError as error:
            # The daemon went away: what is still in the socket comes first.
            while self._take():
                pass
            self._reassembler.flush()
            self._end = error
            return
        if record is not None:
            self._take_control(record)

    def _take(self) -> bool:
        """Takes one message from the socket, several datagrams where the kernel joined them. False: none is there."""
        try:
            size, ancillary, _, source = self._socket.recvmsg_into([self._buffer], _CONTROL_BYTES)
        except BlockingIOError:
            return False
        except OSError as error:
            raise ClosedError(f"udp port {self.terms.udp_port}: {error.strerror}") from error
        segment_bytes = size
        for level, kind, value in ancillary:
            if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                self._account.counters.os_drops = int.from_bytes(value[:4], "little")
            elif level == socket.IPPROTO_UDP and kind == _UDP_GRO:
                segment_bytes = int.from_bytes(value[:4], "little")
        if self._first_byte_ns == 0:
            self._first_byte_ns = time.clock_gettime_ns(time.CLOCK_TAI)
        if self._is_peer(source[0]):
            self._reassembler.push_joined(self._buffer[:size], segment_bytes)
        else:
            self._strangers += max(-(-size // max(segment_bytes, 1)), 1)
        return True

    def _is_peer(self, source: str) -> bool:
        known = self._known_sources.get(source)
        if known is None:
            ip = _plain_ip(source)
            known = ip == self._peer_ip or (":" in ip) != (":" in self._peer_ip)
            if len(self._known_sources) < 64:
                self._known_sources[source] = known
        return known

    def _pop(self) -> ReceivedFrame | None:
        frame = self._reassembler.pop()
        if frame is None:
            return None
        frame.last_byte_ns = time.clock_gettime_ns(time.CLOCK_TAI)
        frame.first_byte_ns = self._first_byte_ns or frame.last_byte_ns
        self._first_byte_ns = 0
        counters = self._account.counters
        if frame.missing_px:
            counters.partial += 1
        else:
            counters.received += 1
        counters.crc_errors += bool(frame.header.flag_bits & FLAG_BITS["corrupt"])
        if frame.header_known:
            self._account.take(frame.header, frame.frames_lost_before)
        else:
            self._account.take_unknown(frame.frames_lost_before)
        return frame

    def _ask_for_missing(self) -> int:
        """Asks the daemon for what is missing, where it is time to. Returns when to look again; 0: no need."""
        while True:
            now_ns = time.monotonic_ns()
            step = self._planner.next(self._reassembler.open_frames(), now_ns)
            if step.kind == "wait":
                return step.wake_ns
            if step.kind == "give_up":
                self._reassembler.give_up(step.frame_id)
                continue
            ranges = self._reassembler.missing(step.frame_id, step.tail, MAX_RESEND_RANGES)
            if not ranges:
                continue
            self._account.counters.resend_requests += 1
            body = encode_resend(self._stream_id, step.frame_id, ranges)
            self._connection.send(encode_record(RECORD_RESEND, body), now_ns + 100_000_000)


def _plain_ip(text: str) -> str:
    """Returns an address without its zone, and an IPv4 address that is mapped into IPv6 as IPv4."""
    address = ipaddress.ip_address(text.split("%")[0])
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(address)


def _interface_index(local_ip: str) -> int:
    """Returns the interface that has the IPv6 address; 0 leaves it to the kernel."""
    wanted = ipaddress.ip_address(local_ip.split("%")[0]).packed.hex()
    try:
        with open("/proc/net/if_inet6", encoding="ascii") as lines:
            for line in lines:
                words = line.split()
                if words[0] == wanted:
                    return int(words[1], 16)
    except OSError:
        pass
    return 0
