"""The few packets of MQTT 3.1.1 that robots and stops of the comparison need. Standard library only.

A packet is a byte of kind and flags, the length of the rest as a varint, and the rest (OASIS, MQTT Version 3.1.1, part 2).
"""
import struct

CONNACK, PUBLISH, PUBACK, SUBACK = 2, 3, 4, 9


def packet(first_byte, rest):
    length, coded = len(rest), bytearray()
    while True:
        length, low = divmod(length, 128)
        coded.append(low | (0x80 if length else 0))
        if not length:
            return bytes((first_byte,)) + bytes(coded) + rest


def text(value):
    coded = value.encode()
    return struct.pack(">H", len(coded)) + coded


def connect(client_id):
    """Clean session, no keep-alive."""
    return packet(0x10, text("MQTT") + bytes((4, 0x02)) + struct.pack(">H", 0) + text(client_id))


def subscribe(packet_id, topic):
    return packet(0x82, struct.pack(">H", packet_id) + text(topic) + b"\x01")


def publish(packet_id, topic, payload, again=False):
    """QoS 1: to be sent until a PUBACK names its packet_id."""
    return packet(0x3A if again else 0x32, text(topic) + struct.pack(">H", packet_id) + payload)


def puback(packet_id):
    return packet(0x40, struct.pack(">H", packet_id))


class Reader:
    """Bytes in, packets out as (kind, first byte, rest)."""

    def __init__(self):
        self.waiting = b""

    def packets(self, received):
        self.waiting += received
        found = []
        while True:
            length, shift, at = 0, 0, 1
            while at < len(self.waiting):
                length |= (self.waiting[at] & 0x7F) << shift
                at, shift = at + 1, shift + 7
                if not self.waiting[at - 1] & 0x80:
                    break
            else:
                return found
            if len(self.waiting) < at + length:
                return found
            found.append((self.waiting[0] >> 4, self.waiting[0], self.waiting[at:at + length]))
            self.waiting = self.waiting[at + length:]


def published(first_byte, rest):
    """(topic, packet_id or None, payload) of a PUBLISH."""
    size, = struct.unpack_from(">H", rest)
    topic, at = rest[2:2 + size].decode(), 2 + size
    if not first_byte & 0x06:
        return topic, None, rest[at:]
    packet_id, = struct.unpack_from(">H", rest, at)
    return topic, packet_id, rest[at + 2:]
