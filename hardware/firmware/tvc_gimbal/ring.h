// A byte queue with an interrupt on one end and the main loop on the other.
#pragma once
#include <stdint.h>

template <uint16_t SIZE>
class Ring {
  static_assert(SIZE <= 256 && (SIZE & (SIZE - 1)) == 0, "indices are one byte: atomic on AVR");

 public:
  // Unchecked: ask room() first; the other end sees nothing before publish().
  void put(uint8_t byte) {
    data_[ahead_] = byte;
    ahead_ = static_cast<uint8_t>((ahead_ + 1) & MASK);
  }
  void publish() {
    asm volatile("" ::: "memory");  // the bytes before the index that shows them
    head_ = ahead_;
  }

  bool push(uint8_t byte) {
    const uint8_t at = head_;
    const uint8_t next = static_cast<uint8_t>((at + 1) & MASK);
    if (next == tail_) return false;
    data_[at] = byte;
    ahead_ = next;
    publish();
    return true;
  }

  bool pop(uint8_t& byte) {
    const uint8_t at = tail_;
    if (head_ == at) return false;
    byte = data_[at];
    asm volatile("" ::: "memory");  // the byte before its room is given away
    tail_ = static_cast<uint8_t>((at + 1) & MASK);
    return true;
  }

  uint8_t used() const { return static_cast<uint8_t>((head_ - tail_) & MASK); }
  uint8_t room() const { return static_cast<uint8_t>(MASK - used()); }

 private:
  static constexpr uint8_t MASK = SIZE - 1;
  uint8_t data_[SIZE];
  uint8_t ahead_ = 0;  // the writer's own: where `put` goes next
  volatile uint8_t head_ = 0;
  volatile uint8_t tail_ = 0;
};
