#include "adc.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "protocol.h"
#include "wake.h"

namespace {

static_assert(wire::POTENTIOMETER_PINS[0] == 14 && wire::POTENTIOMETER_PINS[3] == 17, "A0…A3");
static_assert(wire::JOYSTICK_PINS[0] == 20 && wire::JOYSTICK_PINS[1] == 21, "A6, A7");
constexpr uint8_t AVCC = _BV(REFS0);
constexpr uint8_t JOYSTICK = 6, LAST = 3;
constexpr uint8_t CHANNELS = 8;

uint16_t counts[CHANNELS];
volatile uint8_t channel;
volatile bool running;
uint8_t axis;

}  // namespace

ISR(ADC_vect) {
  const uint16_t count = ADC;  // before ADMUX: simavr converts when the result is read
  const uint8_t done = channel;
  counts[done] = count;
  if (done == LAST) {
    running = false;
    wake();
    return;
  }
  const uint8_t next = done >= JOYSTICK ? 0 : static_cast<uint8_t>(done + 1);
  channel = next;
  ADMUX = AVCC | next;
  ADCSRA |= _BV(ADSC);
}

namespace adc {

void begin() {
  DIDR0 = 0x0F;
  // 125 kHz, the slowest of the range for ten bits: 104 µs each.
  ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
}

void start() {
  if (running) return;
  axis ^= 1;
  channel = static_cast<uint8_t>(JOYSTICK + axis);
  running = true;
  ADMUX = static_cast<uint8_t>(AVCC | channel);
  ADCSRA |= _BV(ADSC);
}

bool busy() { return running; }

void read(uint16_t* potentiometer, uint16_t* joystick) {
  for (uint8_t i = 0; i < 4; ++i) potentiometer[i] = counts[i];
  for (uint8_t i = 0; i < 2; ++i) joystick[i] = counts[JOYSTICK + i];
}

}  // namespace adc
