// Register addresses and values: InvenSense RM-MPU-6000A-00, revision 4.2.
#include "imu.h"

#include <string.h>

#include "protocol.h"

namespace {

constexpr uint8_t SMPLRT_DIV = 0x19, CONFIG = 0x1A, GYRO_CONFIG = 0x1B, ACCEL_CONFIG = 0x1C;
constexpr uint8_t ACCEL_XOUT_H = 0x3B, PWR_MGMT_1 = 0x6B, WHO_AM_I = 0x75;
constexpr uint8_t READING = 14;  // accelerometer, temperature, gyro: three, one, three words
constexpr uint8_t CLOCK_PLL_X = 0x01;

static_assert(wire::GYRO_RANGE_DPS == 500, "FS_SEL below");
static_assert(wire::ACCELEROMETER_RANGE_G == 4, "AFS_SEL below");
constexpr uint8_t FS_SEL_500 = 1 << 3, AFS_SEL_4 = 1 << 3;

constexpr uint8_t STEPS = 6, IDENTIFY = 0, SETTINGS = 1;

void setup_step(uint8_t step, uint8_t dlpf, Transaction& t) {
  const uint8_t reg[STEPS] = {WHO_AM_I, PWR_MGMT_1, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, SMPLRT_DIV};
  const uint8_t value[STEPS] = {0, CLOCK_PLL_X, dlpf, FS_SEL_500, AFS_SEL_4, 0};
  t.reg = reg[step];
  t.value = value[step];
  t.count = step == IDENTIFY;
}

int16_t big_endian(const uint8_t* bytes) {
  return static_cast<int16_t>(static_cast<uint16_t>(bytes[0] << 8) | bytes[1]);
}

bool all_zero(const uint8_t* data) {
  for (uint8_t i = 0; i < READING; ++i)
    if (data[i]) return false;
  return true;
}

}  // namespace

Imus::Imus() : gyro(), accelerometer(), read_us(), fresh(), identity(), dlpf_(wire::DLPF), sensor_(COUNT), step_() {}

void Imus::configure(uint8_t dlpf) {
  if (dlpf == dlpf_) return;
  dlpf_ = dlpf;
  for (uint8_t i = 0; i < COUNT; ++i)
    if (step_[i] > SETTINGS) step_[i] = SETTINGS;
}

void Imus::begin() {
  sensor_ = 0;
  fresh[0] = fresh[1] = false;
}

void Imus::rest() {
  begin();
  sensor_ = COUNT;
}

bool Imus::next(Transaction& t) const {
  if (sensor_ >= COUNT) return false;
  t.address = wire::IMU_ADDRESSES[sensor_];
  if (step_[sensor_] < STEPS) {
    setup_step(step_[sensor_], dlpf_, t);
  } else {
    t.reg = ACCEL_XOUT_H;
    t.count = READING;
  }
  return true;
}

void Imus::done(bool ok, const uint8_t* data, uint32_t now_us) {
  if (sensor_ >= COUNT) return;
  const uint8_t i = sensor_++;
  if (!ok) {
    step_[i] = 0;  // unplugged or browned out: its set-up is lost
    return;
  }
  if (step_[i] < STEPS) {
    if (step_[i] == IDENTIFY) identity[i] = data[0];
    ++step_[i];
    return;
  }
  if (all_zero(data)) {  // asleep: a short dip of its supply has reset it
    step_[i] = 0;
    return;
  }
  for (uint8_t axis = 0; axis < 3; ++axis) {
    accelerometer[i][axis] = big_endian(data + 2 * axis);
    gyro[i][axis] = big_endian(data + 8 + 2 * axis);
  }
  read_us[i] = now_us;
  fresh[i] = true;
}
