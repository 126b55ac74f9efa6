// Serial line, both directions through rings that interrupts fill and empty.
#pragma once
#include <stdint.h>

#include "framing.h"

namespace uart {

void begin();

// Sends what the transmit ring holds.
void kick();

// False when nothing waits. For a delimiter `stamp_us` becomes the clock at its arrival.
bool take(uint8_t& byte, uint32_t& stamp_us);

// Received bytes that found no room; wraps.
uint16_t overruns();

}  // namespace uart
