// Flag by which an interrupt wakes the main loop.
#pragma once
#include <avr/io.h>

// A general-purpose register: set in one instruction, tested in one.
static inline void wake() { GPIOR0 |= _BV(0); }
static inline bool woken() { return GPIOR0 & _BV(0); }
static inline void all_done() { GPIOR0 &= static_cast<uint8_t>(~_BV(0)); }
