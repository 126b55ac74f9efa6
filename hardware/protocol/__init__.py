"""The rig's wire protocol: bytes to frozen messages and back, without any I/O.

>>> wire = Encoder().encode(Command(pulse=(3000, 3100, 0), timeout_ms=100, mode=Mode.DRIVE))
>>> decoder = Decoder()
>>> decoder.receive_data(wire)
>>> decoder.next_event().message.pulse
(3000, 3100, 0)
"""

from hardware.protocol import messages as constants
from hardware.protocol.codec import (
    DELIMITER,
    MAX_ENCODED,
    MAX_PAYLOAD,
    Counters,
    Decoder,
    Encoder,
    Frame,
    Unknown,
    crc16,
    encode,
)
from hardware.protocol.defaults import default_config, hello, plausible
from hardware.protocol.messages import (
    BAUD,
    MESSAGES,
    PROTOCOL,
    SESSION,
    Arm,
    Board,
    Challenge,
    Command,
    Config,
    Disarm,
    Flags,
    Hello,
    HelloRequest,
    Message,
    Mode,
    Name,
    Ping,
    Pong,
    Proof,
    Refusal,
    Refused,
    Telemetry,
    Welcome,
)
from hardware.protocol.table import LAYOUT
from hardware.protocol.wire import layout

__all__ = [
    "BAUD",
    "DELIMITER",
    "LAYOUT",
    "MAX_ENCODED",
    "MAX_PAYLOAD",
    "MESSAGES",
    "PROTOCOL",
    "SESSION",
    "Arm",
    "Board",
    "Challenge",
    "Command",
    "Config",
    "Counters",
    "Decoder",
    "Disarm",
    "Encoder",
    "Flags",
    "Frame",
    "Hello",
    "HelloRequest",
    "Message",
    "Mode",
    "Name",
    "Ping",
    "Pong",
    "Proof",
    "Refusal",
    "Refused",
    "Telemetry",
    "Unknown",
    "Welcome",
    "constants",
    "crc16",
    "default_config",
    "encode",
    "hello",
    "layout",
    "plausible",
]
