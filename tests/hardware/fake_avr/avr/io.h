// Registers of an ATmega328P for the host: memory that reports what is written to it.
// Bit numbers: ATmega328P data sheet, DS40002061B.
#pragma once
#include <stdint.h>

void register_written();  // of the test

template <class T>
class Register {
 public:
  operator T() const { return value_; }
  Register& operator=(T value) {
    value_ = value;
    register_written();
    return *this;
  }
  Register& operator|=(int bits) { return *this = static_cast<T>(value_ | bits); }
  Register& operator&=(int bits) { return *this = static_cast<T>(value_ & bits); }

 private:
  T value_ = 0;
};

#define _BV(bit) (1 << (bit))

extern Register<uint8_t> UCSR0A, UCSR0B, UCSR0C, UDR0, ADMUX, ADCSRA, DIDR0, TWCR, TWSR, TWBR, TWDR;
extern Register<uint8_t> PORTC, DDRC, DDRB, DDRD, GPIOR0;
extern Register<uint8_t> TCCR1A, TCCR1B, TCCR2A, TCCR2B, TCNT2, OCR2B, TIFR1, TIFR2, TIMSK1, TIMSK2;
extern Register<uint16_t> UBRR0, ADC, ICR1, OCR1A, OCR1B, TCNT1;

enum { U2X0 = 1, DOR0 = 3, UCSZ00 = 1, UCSZ01 = 2, TXEN0 = 3, RXEN0 = 4, UDRIE0 = 5, RXCIE0 = 7 };
enum { ADPS0 = 0, ADPS1 = 1, ADPS2 = 2, ADIE = 3, ADSC = 6, ADEN = 7, REFS0 = 6, REFS1 = 7 };
enum { TWIE = 0, TWEN = 2, TWSTO = 4, TWSTA = 5, TWEA = 6, TWINT = 7, PC4 = 4, PC5 = 5 };
enum { DDB1 = 1, DDB2 = 2, DDD3 = 3, TOV1 = 0, TOIE1 = 0, OCF2B = 2, OCIE2B = 2 };
enum { WGM11 = 1, COM1B1 = 5, COM1A1 = 7, CS11 = 1, WGM12 = 3, WGM13 = 4 };
enum { COM2B0 = 4, COM2B1 = 5, CS21 = 1, FOC2B = 6 };
