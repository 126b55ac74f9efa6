// Serial line; interrupts fill the receive ring and empty the transmit ring.
#pragma once
#include <stdint.h>

#include "framing.h"

namespace uart {

void begin();

// Sends what the transmit ring holds.
void kick();

// False if there is none. For a delimiter `stamp_us` becomes the clock at its arrival.
bool take(uint8_t& byte, uint32_t& stamp_us);

// Received bytes lost for lack of room; wraps.
uint16_t overruns();

}  // namespace uart
