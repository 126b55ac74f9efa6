// Three servo pulses at 50 Hz, every edge made by a timer, and the device clock on the same timer.
#pragma once
#include <stdint.h>

namespace servos {

void begin(const uint16_t* pulse);

// Ticks for the next frame, all three in the same one; false within 20 µs of its start: ask again.
bool set(const uint16_t* pulse);

// Ticks of the running frame.
void in_force(uint16_t* pulse);

// Age of the running frame [µs].
uint16_t frame_age_us();

// Device clock [µs]; wraps after 71 minutes.
uint32_t micros();
// The same with interrupts already off.
uint32_t micros_locked();

}  // namespace servos
