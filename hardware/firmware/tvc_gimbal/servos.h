// Three servo pulses at 50 Hz, every edge made by a timer, and the device clock on the same timer.
#pragma once
#include <stdint.h>

namespace servos {

void begin(const uint16_t* pulse);

// Ticks for the next frame, all three in the same one; false within 20 µs of its start: ask again.
bool set(const uint16_t* pulse);

// Ticks of the running frame.
void in_force(uint16_t* pulse);

// Device clock [µs]; wraps after 71 minutes.
uint32_t micros();
// The same with interrupts already off, and with the age of the running frame [µs].
uint32_t micros_locked();
uint32_t micros_locked(uint16_t& frame_us);
// The clock when TCNT1 showed `ticks`, less than one servo frame ago; interrupts off. Interrupts
// keep TCNT1 only: calling the above from one would save and restore every register.
uint32_t since(uint16_t ticks);

}  // namespace servos
