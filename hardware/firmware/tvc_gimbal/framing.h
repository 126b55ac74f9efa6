// COBS frames `type u8 | sequence u16 | payload | CRC-16`, then 0; little-endian, as the AVR is.
#pragma once
#include <stdint.h>

#include "protocol.h"
#include "ring.h"

typedef Ring<256> TransmitRing;

namespace framing {

static constexpr uint8_t HEADER = 3;
static constexpr uint8_t OVERHEAD = HEADER + 2;
static constexpr uint8_t LONGEST = wire::MAX_PAYLOAD + OVERHEAD;

// Polynomial 0x1021, initial 0xFFFF: _crc_xmodem_update of avr-libc, binascii.crc_hqx of Python.
uint16_t crc16(const uint8_t* data, uint8_t size);

}  // namespace framing

// Decodes bytes one by one; returns valid frames and counts the rest.
class Receiver {
 public:
  // True if this byte completed a valid frame, readable until the next byte.
  bool take(uint8_t byte);

  uint8_t type() const { return body_[0]; }
  uint16_t sequence() const { return static_cast<uint16_t>(body_[1] | (body_[2] << 8)); }
  const uint8_t* payload() const { return body_ + framing::HEADER; }
  uint8_t payload_size() const { return static_cast<uint8_t>(size_ - framing::OVERHEAD); }

  uint16_t crc_errors = 0;
  uint16_t lost = 0;

 private:
  void append(uint8_t byte);
  bool finish();
  void count_lost();

  uint8_t body_[framing::LONGEST] = {};
  uint8_t size_ = 0;
  uint8_t code_ = 0;  // of the current COBS block; 0 before the first
  uint8_t left_ = 0;  // bytes still to come in it
  bool overlong_ = false;
  bool complete_ = false;
  bool synchronised_ = false;  // a valid frame has been received
  uint16_t expected_ = 0;
};

// Numbers and stuffs frames into the transmit ring; one without room is dropped and counted.
class Sender {
 public:
  explicit Sender(TransmitRing& ring) : ring_(ring) {}

  template <class Message>
  bool send(const Message& message) {
    static_assert(sizeof(Message) <= wire::MAX_PAYLOAD, "too long for a frame");
    return send(Message::TYPE, &message, sizeof(Message));
  }

  uint16_t skipped = 0;

 private:
  bool send(uint8_t type, const void* payload, uint8_t size);
  void stuff(const uint8_t* body, uint8_t length);

  TransmitRing& ring_;
  uint16_t sequence_ = 0;
};
