// A byte queue between an interrupt and the main loop.
#pragma once
#include <stdint.h>

template <uint16_t SIZE>
class Ring {
  static_assert(SIZE <= 256 && (SIZE & (SIZE - 1)) == 0, "indices are one byte: atomic on AVR");

 public:
  // Writes many bytes quickly. Unchecked: ask room() first. The other end sees no byte before
  // publish(). Its index is a local variable, which the compiler keeps in a register.
  class Writer {
   public:
    explicit Writer(Ring& ring) : ring_(ring), at_(ring.head_) {}
    void put(uint8_t byte) {
      ring_.data_[at_] = byte;
      at_ = static_cast<uint8_t>((at_ + 1) & MASK);
    }
    void publish() {
      asm volatile("" ::: "memory");  // the bytes before the index that shows them
      ring_.head_ = at_;
    }

   private:
    Ring& ring_;
    uint8_t at_;
  };

  bool push(uint8_t byte) {
    const uint8_t at = head_;
    const uint8_t next = static_cast<uint8_t>((at + 1) & MASK);
    if (next == tail_) return false;
    data_[at] = byte;
    asm volatile("" ::: "memory");
    head_ = next;
    return true;
  }

  bool pop(uint8_t& byte) {
    const uint8_t at = tail_;
    if (head_ == at) return false;
    byte = data_[at];
    asm volatile("" ::: "memory");  // the byte is read before its room is released
    tail_ = static_cast<uint8_t>((at + 1) & MASK);
    return true;
  }

  uint8_t used() const { return static_cast<uint8_t>((head_ - tail_) & MASK); }
  uint8_t room() const { return static_cast<uint8_t>(MASK - used()); }

 private:
  static constexpr uint8_t MASK = SIZE - 1;
  uint8_t data_[SIZE] = {};
  volatile uint8_t head_ = 0;
  volatile uint8_t tail_ = 0;
};
