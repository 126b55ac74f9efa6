// The ATmega328P's registers; all decisions are made in core and imu.
#pragma once
#include "core.h"

namespace board {

extern Gimbal gimbal;

void begin();
void poll();

}  // namespace board
