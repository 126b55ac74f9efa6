// Runs the firmware's peripheral code on fake registers and prints what it wrote, a line each.
#include <avr/io.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "adc.h"
#include "board.h"
#include "bus.h"
#include "servos.h"
#include "uart.h"

Register<uint8_t> UCSR0A, UCSR0B, UCSR0C, UDR0, ADMUX, ADCSRA, DIDR0, TWCR, TWSR, TWBR, TWDR;
Register<uint8_t> PORTC, DDRC, DDRB, DDRD, GPIOR0;
Register<uint8_t> TCCR1A, TCCR1B, TCCR2A, TCCR2B, TCNT2, OCR2B, TIFR1, TIFR2, TIMSK1, TIMSK2;
Register<uint16_t> UBRR0, ADC, ICR1, OCR1A, OCR1B, TCNT1;

namespace board {
Gimbal gimbal(wire::BOARD_NANO);
}

extern "C" void ADC_vect();
extern "C" void TIMER1_OVF_vect();

namespace {

// A slave that holds SDA until it has seen a number of clocks, as UM10204 3.1.16 describes.
int holds;       // clocks until it lets go
int clocks;      // whole ones: low, then high
int driven_high; // times at which the master drove the clock line high
int while_on;    // clocks that the peripheral, which owns the pins, does not pass on
double waited, shortest;
bool low;

void watch_clock() {
  const uint8_t scl = 1 << 5;
  const bool driven = DDRC & scl;
  if (driven && (PORTC & scl)) ++driven_high;
  const bool pulled = driven && !(PORTC & scl);
  if (pulled == low) return;
  if (low && !pulled) {
    ++clocks;
    if (TWCR & (1 << 2)) ++while_on;
    if (holds) --holds;
  }
  if (waited < shortest) shortest = waited;
  waited = 0;
  low = pulled;
}

void recover(int count) {
  holds = count;
  clocks = driven_high = while_on = 0;
  shortest = waited = 1e9;
  bus::recover();
  printf("held %d clocks %d driven_high %d while_on %d half_us %g TWCR %d\n", holds, clocks, driven_high,
         while_on, shortest, int(TWCR));
}

void adc_sequences() {
  adc::begin();
  printf("ADCSRA %d\n", int(ADCSRA));
  for (int sequence = 0; sequence < 2; ++sequence) {
    adc::start();
    while (adc::busy()) {
      printf("ADMUX %d\n", int(ADMUX));
      ADC = static_cast<uint16_t>(100 + (ADMUX & 15));
      ADC_vect();
    }
  }
  uint16_t potentiometer[4], joystick[2];
  adc::read(potentiometer, joystick);
  for (uint16_t count : potentiometer) printf("count %d\n", count);
  for (uint16_t count : joystick) printf("count %d\n", count);
}

void in_force() {
  uint16_t pulse[3];
  servos::in_force(pulse);
  printf("in_force %d %d %d\n", pulse[0], pulse[1], pulse[2]);
}

void command(uint16_t ticks) {
  const uint16_t pulse[3] = {ticks, ticks, ticks};
  printf("taken %d\n", servos::set(pulse));
}

// A frame starts; its interrupt runs now, or is pending while `late` is commanded.
void overflow(uint16_t late) {
  TCNT1 = 3;
  TIFR1 = 1;
  if (late) command(late);
  in_force();
  TIFR1 = 0;
  TIMER1_OVF_vect();
  in_force();
}

void servo_frames() {
  const uint16_t begin[3] = {3000, 3000, 3000};
  servos::begin(begin);
  TIFR1 = 0;
  TCNT1 = 1000;
  command(3100);
  in_force();
  overflow(3200);
  TCNT1 = 39970;  // too close to the end for both servos
  command(3900);
  overflow(0);
  overflow(0);
  printf("OCR1 %d %d\n", int(OCR1A), int(OCR1B));
}

}  // namespace

void register_written() { watch_clock(); }
void _delay_us(double duration) { waited += duration; }

int main(int count, char** words) {
  if (count < 2) return 2;
  if (!strcmp(words[1], "uart")) {
    uart::begin();
    printf("UBRR0 %d UCSR0A %d UCSR0B %d UCSR0C %d\n", int(UBRR0), int(UCSR0A), int(UCSR0B), int(UCSR0C));
  } else if (!strcmp(words[1], "adc")) {
    adc_sequences();
  } else if (!strcmp(words[1], "servos")) {
    servo_frames();
  } else {
    bus::begin();
    printf("TWBR %d TWSR %d PORTC %d\n", int(TWBR), int(TWSR), int(PORTC));
    for (int n = 0; n < 10; ++n) recover(n);
  }
}
