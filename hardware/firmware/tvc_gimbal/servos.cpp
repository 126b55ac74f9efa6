// Timer1, fast PWM with ICR1 as top: D9 and D10 directly, double-buffered at the frame's start.
// Timer2, free-running at the same tick: D3. Its compare unit makes both edges; the
// interrupts only arm the next edge up to 128 µs ahead, so their latency does not reach the pin.
#include "servos.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "protocol.h"

namespace {

constexpr uint16_t FRAME_TICKS = wire::PWM_PERIOD_US * 2;
static_assert(wire::TICK_NS == 500, "Timer1 and Timer2 count in 0.5 µs");
constexpr uint16_t GUARD_TICKS = 40;
// The third pulse starts this long after the frame: long enough for the interrupt to arm it.
constexpr uint8_t RISE_TICKS = 200;
constexpr int16_t WRAP_TICKS = 256;
// 40000 mod 256: Timer2 has moved on by this much when Timer1 starts its next frame.
constexpr uint8_t PHASE_STEP = FRAME_TICKS % WRAP_TICKS;

constexpr uint8_t SET_D3 = _BV(COM2B1) | _BV(COM2B0);
constexpr uint8_t CLEAR_D3 = _BV(COM2B1);

enum Edge : uint8_t { IDLE, RISING, HIGH_LEVEL, FALLING };

volatile uint16_t wanted[3];
volatile uint16_t latched[3];
volatile bool latched_early;
volatile uint32_t frame_start_us;
uint8_t phase;  // of Timer2 at the frame's start
volatile Edge edge;

// Follows what the hardware did at the frame's start: OCR1A and OCR1B went into force.
void latch() {
  for (uint8_t i = 0; i < 3; ++i) latched[i] = wanted[i];
}

}  // namespace

ISR(TIMER1_OVF_vect) {
  frame_start_us += wire::PWM_PERIOD_US;
  if (!latched_early) latch();
  latched_early = false;
  phase = static_cast<uint8_t>(phase + PHASE_STEP);
  OCR2B = static_cast<uint8_t>(phase + RISE_TICKS);
  TCCR2A = SET_D3;
  TIFR2 = _BV(OCF2B);
  TIMSK2 = _BV(OCIE2B);
  edge = RISING;
}

ISR(TIMER2_COMPB_vect) {
  const uint16_t width = latched[2];
  switch (edge) {
    case RISING:
      // One match in every wrap from here on; the last of them is the falling edge.
      OCR2B = static_cast<uint8_t>(phase + RISE_TICKS + width);
      edge = HIGH_LEVEL;
      break;
    case HIGH_LEVEL:
      if (static_cast<int16_t>(RISE_TICKS + width - TCNT1) <= WRAP_TICKS) {
        TCCR2A = CLEAR_D3;
        edge = FALLING;
      }
      break;
    default:
      TIMSK2 = 0;
      edge = IDLE;
      break;
  }
}

namespace servos {

void begin(const uint16_t* pulse) {
  for (uint8_t i = 0; i < 3; ++i) wanted[i] = latched[i] = pulse[i];
  TCCR1A = 0;
  TCCR1B = 0;
  ICR1 = FRAME_TICKS - 1;  // before the mode: a top of zero would wrap at once
  OCR1A = static_cast<uint16_t>(pulse[0] - 1);  // high for OCR + 1 ticks
  OCR1B = static_cast<uint16_t>(pulse[1] - 1);
  TCNT1 = 0;
  TCCR2A = CLEAR_D3;
  TCCR2B = 0;
  TCNT2 = 0;
  DDRB |= _BV(DDB1) | _BV(DDB2);
  DDRD |= _BV(DDD3);
  TCCR1A = _BV(COM1A1) | _BV(COM1B1) | _BV(WGM11);
  TCCR2B = _BV(FOC2B) | _BV(CS21);
  TCCR1B = _BV(WGM13) | _BV(WGM12) | _BV(CS11);
  const uint16_t frame = TCNT1;
  phase = static_cast<uint8_t>(TCNT2 - frame);
  TIFR1 = _BV(TOV1);
  TIMSK1 = _BV(TOIE1);
}

bool set(const uint16_t* pulse) {
  bool taken = false;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    const uint16_t age = TCNT1;
    // Too close to the end, x could go into force one frame before y.
    if (age < FRAME_TICKS - GUARD_TICKS) {
      if ((TIFR1 & _BV(TOV1)) && !latched_early) {
        latch();  // a frame has started whose interrupt is pending
        latched_early = true;
      }
      for (uint8_t i = 0; i < 3; ++i) wanted[i] = pulse[i];
      OCR1A = static_cast<uint16_t>(pulse[0] - 1);
      OCR1B = static_cast<uint16_t>(pulse[1] - 1);
      taken = true;
    }
  }
  return taken;
}

void in_force(uint16_t* pulse) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    for (uint8_t i = 0; i < 3; ++i) pulse[i] = latched[i];
  }
}

uint32_t micros_locked(uint16_t& frame_us) {
  frame_us = TCNT1 / 2;
  uint32_t start = frame_start_us;
  // Overflowed, and its interrupt has not run: the count is of the new frame already.
  if ((TIFR1 & _BV(TOV1)) && frame_us < wire::PWM_PERIOD_US / 2) start += wire::PWM_PERIOD_US;
  return start + frame_us;
}

uint32_t micros_locked() {
  uint16_t frame_us;
  return micros_locked(frame_us);
}

uint32_t since(uint16_t ticks) {
  uint16_t now_in_frame;
  const uint32_t now = micros_locked(now_in_frame);
  const uint16_t then = ticks / 2;
  uint16_t age = static_cast<uint16_t>(now_in_frame - then);
  if (now_in_frame < then) age = static_cast<uint16_t>(age + wire::PWM_PERIOD_US);
  return now - age;
}

uint32_t micros() {
  uint32_t now;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = micros_locked(); }
  return now;
}

}  // namespace servos
