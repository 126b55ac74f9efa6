// Interrupt-driven I2C master at 400 kHz.
#pragma once
#include <stdint.h>

#include "imu.h"

namespace bus {

enum State : uint8_t { FREE, BUSY, DONE, FAILED };

void begin();
void start(const Transaction& transaction);
State state();
// The bytes read, valid in DONE.
const uint8_t* data();
// TCNT1 when the transaction began: a sensor holds its registers from then on.
uint16_t began();
// Back to FREE after DONE or FAILED.
void release();
// Aborts the transaction and frees a line that a sensor holds.
void recover();

}  // namespace bus
