// Two MPU6050 on one bus: the next transaction, and the decoding of its result.
#pragma once
#include <stdint.h>

// A write of one register, or a read of `count` bytes from `reg` on.
struct Transaction {
  uint8_t address;
  uint8_t reg;
  uint8_t value;
  uint8_t count;  // 0: write `value`
};

class Imus {
 public:
  static constexpr uint8_t COUNT = 2;

  Imus();

  // Sets both up again with another low-pass filter; readings stop meanwhile.
  void configure(uint8_t dlpf);
  // Starts a round: each sensor is read once, or one more register of its set-up is written.
  void begin();
  // Starts a round in which neither is read.
  void rest();
  // False at the end of the round.
  bool next(Transaction& transaction) const;
  void done(bool ok, const uint8_t* data, uint32_t now_us);

  int16_t gyro[COUNT][3];
  int16_t accelerometer[COUNT][3];
  uint32_t read_us[COUNT];
  bool fresh[COUNT];  // read in this round
  uint8_t identity[COUNT];  // WHO_AM_I, 0 before it is read

 private:
  uint8_t dlpf_;
  uint8_t sensor_;        // current
  uint8_t step_[COUNT];   // set-up registers written so far
};
