// The ATmega328P's registers behind two calls; everything that decides is in core and imu.
#pragma once

namespace board {

void begin();
void poll();

}  // namespace board
