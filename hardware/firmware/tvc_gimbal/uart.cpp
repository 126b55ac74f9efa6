#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board.h"
#include "servos.h"
#include "wake.h"

namespace {

constexpr uint8_t STAMPS = 32;  // the ring holds at most 18 frames

Ring<128> received;
volatile uint16_t stamps[STAMPS];  // arrivals of the latest delimiters: ticks into a servo frame
volatile uint8_t delimiters;
uint8_t delimiters_taken;
volatile uint16_t lost;

}  // namespace

ISR(USART_RX_vect) {
  if (UCSR0A & _BV(DOR0)) ++lost;  // before UDR0: reading it clears the flag
  const uint8_t byte = UDR0;
  if (!received.push(byte)) {
    ++lost;
    return;  // a delimiter that is not queued must not be counted
  }
  if (byte != 0) return;  // wake for a frame, not for a byte
  stamps[delimiters % STAMPS] = TCNT1;
  ++delimiters;
  wake();
}

ISR(USART_UDRE_vect) {
  uint8_t byte;
  if (board::gimbal.transmit.pop(byte))
    UDR0 = byte;
  else
    UCSR0B &= static_cast<uint8_t>(~_BV(UDRIE0));
}

namespace uart {

void begin() {
  UCSR0A = _BV(U2X0);  // both before UBRR0: simavr takes the rate when that is written
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UBRR0 = F_CPU / 8 / wire::BAUD - 1;
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

void kick() {
  if (board::gimbal.transmit.used() == 0) return;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { UCSR0B |= _BV(UDRIE0); }
}

bool take(uint8_t& byte, uint32_t& stamp_us) {
  if (!received.pop(byte)) return false;
  if (byte == 0) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { stamp_us = servos::since(stamps[delimiters_taken % STAMPS]); }
    ++delimiters_taken;
  }
  return true;
}

uint16_t overruns() {
  uint16_t count;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { count = lost; }
  return count;
}

}  // namespace uart
