#include "framing.h"

#include <string.h>

#ifdef __AVR__
#include <util/crc16.h>
#endif

namespace framing {

#ifndef __AVR__
static uint16_t _crc_xmodem_update(uint16_t crc, uint8_t byte) {
  crc = static_cast<uint16_t>(crc ^ (byte << 8));
  for (uint8_t bit = 0; bit < 8; ++bit)
    crc = static_cast<uint16_t>(crc & 0x8000 ? (crc << 1) ^ 0x1021 : crc << 1);
  return crc;
}
#endif

uint16_t crc16(const uint8_t* data, uint8_t size) {
  uint16_t crc = 0xFFFF;
  while (size--) crc = _crc_xmodem_update(crc, *data++);
  return crc;
}

}  // namespace framing

bool Receiver::take(uint8_t byte) {
  if (complete_) {
    complete_ = false;
    size_ = 0;
  }
  if (byte == 0) return finish();
  if (left_ > 0) {
    --left_;
    append(byte);
    return false;
  }
  // A block shorter than 255 stands for its bytes and the zero that ended it.
  if (code_ != 0 && code_ != 0xFF) append(0);
  code_ = byte;
  left_ = static_cast<uint8_t>(byte - 1);
  return false;
}

void Receiver::append(uint8_t byte) {
  if (size_ < framing::LONGEST)
    body_[size_++] = byte;
  else
    overlong_ = true;
}

bool Receiver::finish() {
  const bool empty = code_ == 0;
  bool valid = !overlong_ && left_ == 0 && size_ >= framing::OVERHEAD;
  code_ = left_ = 0;
  overlong_ = false;
  if (empty) return false;
  if (valid) {
    const uint8_t* tail = body_ + size_ - 2;
    valid = framing::crc16(body_, static_cast<uint8_t>(size_ - 2)) ==
            static_cast<uint16_t>(tail[0] | (tail[1] << 8));
  }
  if (!valid) {
    // Before the first valid frame the host may have opened the port in mid-frame.
    if (synchronised_) ++crc_errors;
    size_ = 0;
    return false;
  }
  complete_ = true;
  count_lost();
  return true;
}

void Receiver::count_lost() {
  const uint16_t missed = static_cast<uint16_t>(sequence() - expected_);
  // An earlier number is a host that started again, not a loss.
  if (synchronised_ && missed < 0x8000) lost = static_cast<uint16_t>(lost + missed);
  expected_ = static_cast<uint16_t>(sequence() + 1);
  synchronised_ = true;
}

bool Sender::send(uint8_t type, const void* payload, uint8_t size) {
  uint8_t body[framing::LONGEST];
  uint8_t length = static_cast<uint8_t>(size + framing::HEADER);
  // Frames stay below 255 bytes, so stuffing costs one byte; the delimiter is another.
  if (ring_.room() < length + 4) {
    ++skipped;
    return false;
  }
  body[0] = type;
  body[1] = static_cast<uint8_t>(sequence_);
  body[2] = static_cast<uint8_t>(sequence_ >> 8);
  memcpy(body + framing::HEADER, payload, size);
  const uint16_t crc = framing::crc16(body, length);
  body[length++] = static_cast<uint8_t>(crc);
  body[length++] = static_cast<uint8_t>(crc >> 8);
  ++sequence_;

  stuff(body, length);
  return true;
}

void Sender::stuff(const uint8_t* body, uint8_t length) {
  TransmitRing::Writer out(ring_);
  const uint8_t* const end = body + length;
  for (const uint8_t* run = body;;) {
    const uint8_t* stop = run;
    while (stop < end && *stop != 0) ++stop;
    out.put(static_cast<uint8_t>(stop - run + 1));
    while (run < stop) out.put(*run++);
    if (run == end) break;
    ++run;  // over the zero, which the length byte stands for
  }
  out.put(0);
  out.publish();
}
