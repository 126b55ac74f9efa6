// A byte queue with an interrupt on one end and the main loop on the other.
#pragma once
#include <stdint.h>

template <uint16_t SIZE>
class Ring {
  static_assert(SIZE <= 256 && (SIZE & (SIZE - 1)) == 0, "indices are one byte: atomic on AVR");

 public:
  bool push(uint8_t byte) {
    const uint8_t next = static_cast<uint8_t>((head_ + 1) & MASK);
    if (next == tail_) return false;
    data_[head_] = byte;
    head_ = next;
    return true;
  }

  bool pop(uint8_t& byte) {
    if (head_ == tail_) return false;
    byte = data_[tail_];
    tail_ = static_cast<uint8_t>((tail_ + 1) & MASK);
    return true;
  }

  uint8_t used() const { return static_cast<uint8_t>((head_ - tail_) & MASK); }
  uint8_t room() const { return static_cast<uint8_t>(MASK - used()); }

 private:
  static constexpr uint8_t MASK = SIZE - 1;
  volatile uint8_t data_[SIZE];
  volatile uint8_t head_ = 0;
  volatile uint8_t tail_ = 0;
};
