// Gimbal rig on an Arduino Nano (ATmega328P, 16 MHz): servos, potentiometers, IMUs, switches.
// Wiring: docs/wiring.md. The wire: docs/protocol.md. Serial port: 500000 baud.
// Do not use Serial, Wire, Servo or analogRead here: their registers are in use.
#include "board.h"

void setup() { board::begin(); }

void loop() { board::poll(); }
