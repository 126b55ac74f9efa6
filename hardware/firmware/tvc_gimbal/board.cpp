#include "board.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/atomic.h>

#include "bus.h"
#include "core.h"
#include "imu.h"
#include "servos.h"

namespace {

// Potentiometers every round, the joystick's two axes in turn: 5 conversions of 104 µs.
constexpr uint8_t CHANNELS = 6;
const uint8_t MUX[CHANNELS] = {0, 1, 2, 3, 6, 7};
static_assert(wire::POTENTIOMETER_PINS[0] == 14 && wire::JOYSTICK_PINS[0] == 20, "MUX above");
constexpr uint8_t AVCC = _BV(REFS0);
constexpr uint8_t STAMPS = 4;

volatile uint16_t converted[CHANNELS];
uint8_t channel;
bool joystick_y;

Ring<128> received;
volatile uint32_t stamps[STAMPS];  // when the latest delimiters arrived
volatile uint8_t delimiters;
uint8_t delimiters_taken;
volatile uint16_t overruns;

volatile uint8_t ticks;  // 1 ms each

Gimbal* gimbal;
Imus* imus;
uint8_t last_tick;
uint8_t countdown;
bool round_running;
uint16_t applied[3];

}  // namespace

ISR(ADC_vect) {
  converted[channel] = ADC;  // before ADMUX: simavr converts when the result is read
  if (channel < 3) {
    ++channel;
  } else if (channel == 3) {
    channel = joystick_y ? 5 : 4;
    joystick_y = !joystick_y;
  } else {
    channel = 0;
  }
  ADMUX = AVCC | MUX[channel];
  ADCSRA |= _BV(ADSC);
}

ISR(USART_RX_vect) {
  if (UCSR0A & _BV(DOR0)) ++overruns;  // before UDR0: reading it clears the flag
  const uint8_t byte = UDR0;
  if (!received.push(byte)) {
    ++overruns;
  } else if (byte == 0) {
    stamps[delimiters % STAMPS] = servos::micros_locked();
    ++delimiters;
  }
}

ISR(USART_UDRE_vect) {
  uint8_t byte;
  if (gimbal->transmit.pop(byte))
    UDR0 = byte;
  else
    UCSR0B &= static_cast<uint8_t>(~_BV(UDRIE0));
}

ISR(TIMER0_COMPA_vect) { ++ticks; }

namespace {

void begin_uart() {
  UCSR0A = _BV(U2X0);
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UBRR0 = F_CPU / 8 / wire::BAUD - 1;
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

void begin_adc() {
  DIDR0 = 0x0F;
  ADMUX = AVCC | MUX[0];
  ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
  ADCSRA |= _BV(ADSC);
}

void begin_pins() {
  PORTD |= _BV(PD2) | _BV(PD4) | _BV(PD5) | _BV(PD7);  // limit switches close to ground
  DDRB |= _BV(DDB5);
}

void begin_tick() {
  TCCR0A = _BV(WGM01);
  TCCR0B = _BV(CS01) | _BV(CS00);
  OCR0A = F_CPU / 64 / 1000 - 1;
  TIMSK0 = _BV(OCIE0A);  // and so ends the Arduino core's own Timer0 interrupt
}

uint8_t read_switches() {
  const uint8_t pins = static_cast<uint8_t>(~PIND);
  uint8_t closed = 0;
  if (pins & _BV(PD2)) closed |= 1;
  if (pins & _BV(PD4)) closed |= 2;
  if (pins & _BV(PD5)) closed |= 4;
  if (pins & _BV(PD7)) closed |= 8;
  return closed;
}

void take_bytes() {
  uint8_t byte;
  while (received.pop(byte)) {
    uint32_t stamp = 0;
    if (byte == 0) {
      ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { stamp = stamps[delimiters_taken % STAMPS]; }
      ++delimiters_taken;
    }
    gimbal->receive(byte, stamp, byte ? 0 : servos::micros());
  }
}

void apply_pulses() {
  const uint16_t* pulse = gimbal->pulse();
  if (pulse[0] == applied[0] && pulse[1] == applied[1] && pulse[2] == applied[2]) return;
  if (!servos::set(pulse)) return;
  for (uint8_t i = 0; i < 3; ++i) applied[i] = pulse[i];
}

void report() {
  Sample s;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    s.device_us = servos::micros_locked();
    s.frame_us = servos::frame_age_us();
    for (uint8_t i = 0; i < 4; ++i) s.potentiometer[i] = converted[i];
    for (uint8_t i = 0; i < 2; ++i) s.joystick[i] = converted[4 + i];
    s.overruns = overruns;
    servos::in_force(s.pulse);
  }
  for (uint8_t i = 0; i < Imus::COUNT; ++i) {
    for (uint8_t axis = 0; axis < 3; ++axis) {
      s.gyro[i][axis] = imus->gyro[i][axis];
      s.accelerometer[i][axis] = imus->accelerometer[i][axis];
    }
    const uint32_t age = s.device_us - imus->read_us[i];
    s.imu_age_us[i] = age < 0xFFFF ? static_cast<uint16_t>(age) : 0xFFFF;
    s.imu_fresh[i] = imus->fresh[i];
  }
  s.switches = read_switches();
  gimbal->report(s);
}

void start_round() {
  if (bus::state() == bus::BUSY) {
    bus::recover();
    imus->done(false, nullptr, 0);
  }
  imus->configure(gimbal->dlpf());
  imus->begin();
  round_running = true;
}

// Telemetry leaves when both sensors have answered, or at the next tick at the latest.
void run_round() {
  if (!round_running || bus::state() == bus::BUSY) return;
  if (bus::state() != bus::FREE) {
    imus->done(bus::state() == bus::DONE, bus::data(), servos::micros());
    bus::release();
  }
  Transaction transaction;
  if (imus->next(transaction)) {
    bus::start(transaction);
  } else {
    round_running = false;
    report();
  }
}

void take_ticks() {
  while (last_tick != ticks) {
    ++last_tick;
    if (--countdown) continue;
    countdown = gimbal->telemetry_period_ms();
    if (round_running) report();
    start_round();
  }
}

void sleep_if_idle() {
  cli();
  const bool idle = received.used() == 0 && last_tick == ticks &&
                    !(round_running && bus::state() != bus::BUSY);
  if (idle) {
    sleep_enable();
    sei();  // takes effect after the next instruction, so no interrupt slips in before sleep
    sleep_cpu();
    sleep_disable();
  }
  sei();
}

}  // namespace

namespace board {

void begin() {
  const uint8_t reset_cause = MCUSR;  // zero under a bootloader that has cleared it
  MCUSR = 0;
  cli();
  // After the Arduino core's set-up, or without it: static storage, built here.
  static Gimbal the_gimbal(wire::BOARD_NANO, reset_cause);
  static Imus the_imus;
  gimbal = &the_gimbal;
  imus = &the_imus;
  for (uint8_t i = 0; i < 3; ++i) applied[i] = gimbal->pulse()[i];
  countdown = gimbal->telemetry_period_ms();
  begin_pins();
  servos::begin(gimbal->pulse());
  begin_uart();
  begin_adc();
  bus::begin();
  begin_tick();
  SMCR = 0;  // idle: every peripheral wakes it
  sei();
  gimbal->transmit.push(0);  // ends whatever noise the line carried before
  gimbal->hello();
}

void poll() {
  take_bytes();
  gimbal->update(servos::micros());
  apply_pulses();
  run_round();
  take_ticks();
  if (gimbal->transmit.used())
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { UCSR0B |= _BV(UDRIE0); }
  if (gimbal->armed())
    PORTB |= _BV(PB5);
  else
    PORTB &= static_cast<uint8_t>(~_BV(PB5));
  sleep_if_idle();
}

}  // namespace board
