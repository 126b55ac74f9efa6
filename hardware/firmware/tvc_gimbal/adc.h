// Potentiometers and joystick, converted one after the other in the interrupt.
#pragma once
#include <stdint.h>

namespace adc {

void begin();

// Starts a sequence: one joystick axis (the two alternate), then x_a, x_b, y_a, y_b.
void start();
bool busy();

// The latest counts, valid while not busy.
void read(uint16_t* potentiometer, uint16_t* joystick);

}  // namespace adc
