// The ATmega328P's registers behind two calls; everything that decides is in core and imu.
#pragma once
#include "core.h"

namespace board {

extern Gimbal gimbal;

void begin();
void poll();

}  // namespace board
