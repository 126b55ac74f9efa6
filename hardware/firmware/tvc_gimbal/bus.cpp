#include "bus.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>
#include <util/delay.h>
#include <util/twi.h>

#include "wake.h"

namespace {

constexpr uint8_t GO = _BV(TWINT) | _BV(TWEN) | _BV(TWIE);
constexpr uint8_t SDA = _BV(PC4), SCL = _BV(PC5);

Transaction current;
uint8_t bytes[16];
volatile uint8_t at;        // bytes sent or received
volatile bus::State now = bus::FREE;
uint16_t start_ticks;

inline void finish(bus::State end) {
  TWCR = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);
  now = end;
  wake();
}

inline void sent() {
  switch (at++) {
    case 0:
      TWDR = current.reg;
      TWCR = GO;
      break;
    case 1:
      if (current.count) {
        TWCR = GO | _BV(TWSTA);
      } else {
        TWDR = current.value;
        TWCR = GO;
      }
      break;
    default:
      finish(bus::DONE);
  }
}

// The last byte wanted is answered with NACK.
inline void receive_next() { TWCR = at + 1 < current.count ? GO | _BV(TWEA) : GO; }

}  // namespace

ISR(TWI_vect) {
  switch (TW_STATUS) {
    case TW_START:
      TWDR = static_cast<uint8_t>(current.address << 1);
      TWCR = GO;
      break;
    case TW_REP_START:
      at = 0;
      TWDR = static_cast<uint8_t>(current.address << 1 | 1);
      TWCR = GO;
      break;
    case TW_MT_SLA_ACK:
    case TW_MT_DATA_ACK:  // simavr reports this one for the address as well
      sent();
      break;
    case TW_MR_SLA_ACK:
      receive_next();
      break;
    case TW_MR_DATA_ACK:
      bytes[at++] = TWDR;
      receive_next();
      break;
    case TW_MR_DATA_NACK:
      bytes[at] = TWDR;
      finish(bus::DONE);
      break;
    default:
      finish(bus::FAILED);
  }
}

namespace bus {

void begin() {
  TWSR = 0;
  TWBR = (F_CPU / 400000UL - 16) / 2;
  // The modules have pull-ups; these are for chips without a module.
  PORTC |= SDA | SCL;
  TWCR = _BV(TWEN);
}

void start(const Transaction& transaction) {
  for (uint8_t wait = 100; (TWCR & _BV(TWSTO)) && wait; --wait) {
  }
  current = transaction;
  at = 0;
  now = BUSY;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { start_ticks = TCNT1; }
  TWCR = GO | _BV(TWSTA);
}

State state() { return now; }

const uint8_t* data() { return bytes; }

uint16_t began() { return start_ticks; }

void release() { now = FREE; }

void recover() {
  TWCR = 0;
  // UM10204 3.1.16: nine clocks make a slave release SDA.
  for (uint8_t pulse = 0; pulse < 9; ++pulse) {
    PORTC &= static_cast<uint8_t>(~SCL);
    DDRC |= SCL;
    _delay_us(5);
    DDRC &= static_cast<uint8_t>(~SCL);
    PORTC |= SCL;
    _delay_us(5);
  }
  now = FREE;
  begin();
}

}  // namespace bus
