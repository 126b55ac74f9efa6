#include "board.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#include "adc.h"
#include "bus.h"
#include "imu.h"
#include "servos.h"
#include "uart.h"
#include "wake.h"

namespace board {

Gimbal gimbal(wire::BOARD_NANO);

}  // namespace board

namespace {

using board::gimbal;

volatile uint8_t ticks;  // 1 ms each
uint8_t last_tick;
uint8_t countdown;  // ticks to the next round

Imus imus;
bool round_running;
bool converting;  // this round's conversions have been started

// A bus that has hung may hang again: rounds leave it out for a while.
constexpr uint8_t REST = 50;
uint8_t resting;  // rounds still without the bus

// Address in the EEPROM; not 0, which a brown-out corrupts first.
uint8_t* const SERIAL = reinterpret_cast<uint8_t*>(16);
constexpr uint8_t SERIAL_BYTES = sizeof(uint32_t) + 1;  // the check byte is written last
uint8_t serial_kept;                                    // bytes written

uint16_t applied[3];
bool pulses_wait;  // for the next servo frame to start
bool frames_wait;  // more bytes than one frame have been received

// Optiboot clears MCUSR and passes it on in r2. Kept before the C start-up code uses registers.
uint8_t passed_on __attribute__((section(".noinit")));

}  // namespace

extern "C" void keep_reset_cause() __attribute__((naked, used, section(".init0")));
void keep_reset_cause() { asm volatile("sts %0, r2" : : "i"(&passed_on)); }

ISR(TIMER0_COMPA_vect) {
  ++ticks;
  wake();
}

namespace {

void begin_pins() {
  PORTD |= _BV(PD2) | _BV(PD4) | _BV(PD5) | _BV(PD7);  // limit switches close to ground
  DDRB |= _BV(DDB5);
}

void begin_tick() {
  TCCR0A = _BV(WGM01);
  TCCR0B = _BV(CS01) | _BV(CS00);
  OCR0A = F_CPU / 64 / 1000 - 1;
  TIMSK0 = _BV(OCIE0A);  // replaces the Timer0 interrupt of the Arduino core
}

uint8_t read_switches() {
  const uint8_t closed = static_cast<uint8_t>(~PIND);
  return static_cast<uint8_t>(((closed & _BV(PD2)) ? 1 : 0) | ((closed & _BV(PD4)) ? 2 : 0) |
                              ((closed & _BV(PD5)) ? 4 : 0) | ((closed & _BV(PD7)) ? 8 : 0));
}

void show_armed() {
  if (gimbal.armed())
    PORTB |= _BV(PB5);
  else
    PORTB &= static_cast<uint8_t>(~_BV(PB5));
}

void take_bytes() {
  uint8_t byte;
  uint32_t stamp_us = 0;
  while (uart::take(byte, stamp_us)) {
    if (!gimbal.receive(byte)) continue;
    gimbal.obey(stamp_us, servos::micros());
    frames_wait = true;  // one at a time: a flood does not delay the sensors
    return;
  }
  frames_wait = false;
}

void apply_pulses() {
  const uint16_t* pulse = gimbal.pulse();
  pulses_wait = pulse[0] != applied[0] || pulse[1] != applied[1] || pulse[2] != applied[2];
  if (!pulses_wait || !servos::set(pulse)) return;
  for (uint8_t i = 0; i < 3; ++i) applied[i] = pulse[i];
  pulses_wait = false;
}

uint8_t serial_byte(uint32_t serial, uint8_t at) {
  if (at < sizeof serial) return static_cast<uint8_t>(serial >> (8 * at));
  uint8_t check = 0x5A;
  for (uint8_t i = 0; i < sizeof serial; ++i)
    check = static_cast<uint8_t>(check ^ serial_byte(serial, i));
  return check;
}

// A byte takes 3.4 ms to write; the main loop does not wait for it.
void keep_serial() {
  if (serial_kept == SERIAL_BYTES || gimbal.serial() == wire::SERIAL_NONE) return;
  if (!eeprom_is_ready()) return;
  eeprom_update_byte(SERIAL + serial_kept, serial_byte(gimbal.serial(), serial_kept));
  ++serial_kept;
}

// A number whose writing was interrupted by a power failure does not count.
uint32_t kept_serial() {
  const uint32_t serial = eeprom_read_dword(reinterpret_cast<const uint32_t*>(SERIAL));
  const uint8_t check = eeprom_read_byte(SERIAL + sizeof serial);
  return check == serial_byte(serial, sizeof serial) ? serial : wire::SERIAL_BLANK;
}

void report() {
  Sample s;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    s.device_us = servos::micros_locked(s.frame_us);
    servos::in_force(s.pulse);
  }
  adc::read(s.potentiometer, s.joystick);
  for (uint8_t i = 0; i < Imus::COUNT; ++i) {
    for (uint8_t axis = 0; axis < 3; ++axis) {
      s.gyro[i][axis] = imus.gyro[i][axis];
      s.accelerometer[i][axis] = imus.accelerometer[i][axis];
    }
    const uint32_t age = s.device_us - imus.read_us[i];
    s.imu_age_us[i] = age < 0xFFFF ? static_cast<uint16_t>(age) : 0xFFFF;
    s.imu_fresh[i] = imus.fresh[i];
    gimbal.imu_identity[i] = imus.identity[i];
  }
  s.switches = read_switches();
  s.overruns = uart::overruns();
  gimbal.report(s);
  uart::kick();  // before anything else is queued: the stamp of PONG assumes that the line is sending
}

// The conversions begin when the holder's IMU has been read and end about when the base's has.
void run_round() {
  if (!round_running || bus::state() == bus::BUSY) return;
  if (bus::state() != bus::FREE) {
    uint32_t began_us;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { began_us = servos::since(bus::began()); }
    imus.done(bus::state() == bus::DONE, bus::data(), began_us);
    bus::release();
    if (!converting) adc::start();
    converting = true;
  }
  Transaction transaction;
  if (imus.next(transaction)) {
    bus::start(transaction);
  } else if (!adc::busy()) {
    round_running = false;
    report();
  }
}

void start_round() {
  if (round_running && bus::state() == bus::BUSY) {  // a sensor holds the bus
    bus::recover();
    resting = REST;
  } else if (round_running) {
    return;  // delayed by a flood: it reports late, and this tick's round is skipped
  }
  imus.configure(gimbal.dlpf());
  round_running = true;
  converting = resting > 0;
  if (resting) {
    --resting;
    imus.rest();
    adc::start();
  } else {
    imus.begin();
  }
  run_round();
}

void take_ticks() {
  while (last_tick != ticks) {
    ++last_tick;
    if (--countdown) continue;
    countdown = gimbal.telemetry_period_ms();
    start_round();
  }
}

// Most interrupts (a byte sent, a conversion) give the main loop no work.
void sleep_until_woken() {
  cli();
  while (!woken() && !pulses_wait && !frames_wait) {
    sei();  // takes effect after the next instruction, so no interrupt slips in before sleep
    sleep_cpu();
    cli();
  }
  all_done();
  sei();
}

}  // namespace

namespace board {

void begin() {
  uint8_t reset_cause = MCUSR;
  // Older bootloaders clear MCUSR as well, and leave anything in r2.
  if (reset_cause == 0 && passed_on <= (_BV(PORF) | _BV(EXTRF) | _BV(BORF) | _BV(WDRF)))
    reset_cause = passed_on;
  MCUSR = 0;
  cli();
  wdt_enable(WDTO_120MS);  // the timers would repeat the last pulses without the program
  for (uint8_t i = 0; i < 3; ++i) applied[i] = gimbal.pulse()[i];
  countdown = gimbal.telemetry_period_ms();
  begin_pins();
  servos::begin(gimbal.pulse());
  uart::begin();
  adc::begin();
  bus::begin();
  begin_tick();
  SMCR = _BV(SE);  // idle: every peripheral wakes it
  sei();
  gimbal.boot(reset_cause, kept_serial());
}

void poll() {
  wdt_reset();
  take_ticks();
  run_round();  // first, so that frames are read while the bus is at work
  take_bytes();
  gimbal.update(servos::micros());
  apply_pulses();
  keep_serial();
  uart::kick();
  show_armed();
  sleep_until_woken();
}

}  // namespace board
