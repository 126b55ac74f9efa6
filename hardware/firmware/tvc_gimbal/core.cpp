#include "core.h"

#include <string.h>

#include "version.h"

namespace {

// Start bit, eight data bits, stop bit.
constexpr uint32_t BYTE_US = uint32_t{10000000} / wire::BAUD;

template <class Message>
bool read(const Receiver& receiver, Message& message) {
  if (receiver.payload_size() != sizeof(Message)) return false;
  memcpy(&message, receiver.payload(), sizeof(Message));
  return true;
}

bool plausible(const wire::Config& config) {
  if (config.telemetry_period_ms < wire::TELEMETRY_PERIOD_SHORTEST_MS ||
      config.telemetry_period_ms > wire::TELEMETRY_PERIOD_LONGEST_MS ||
      config.dlpf > wire::DLPF_HIGHEST)
    return false;
  for (uint8_t i = 0; i < 3; ++i) {
    if (config.minimum[i] < wire::PULSE_LOWEST || config.neutral[i] < config.minimum[i] ||
        config.maximum[i] < config.neutral[i] || config.maximum[i] > wire::PULSE_HIGHEST)
      return false;
  }
  return true;
}

}  // namespace

Gimbal::Gimbal(uint8_t board)
    : transmit(),
      imu_identity(),
      receiver_(),
      sender_(transmit),
      config_(),
      flags_(0),
      acknowledged_(0),
      overruns_(0),
      overruns_seen_(0),
      deadline_us_(0),
      serial_(wire::SERIAL_NONE),
      board_(board),
      reset_cause_(0) {
  config_.telemetry_period_ms = wire::TELEMETRY_PERIOD_MS;
  config_.dlpf = wire::DLPF;
  for (uint8_t i = 0; i < 3; ++i) {
    config_.neutral[i] = wire::PULSE_NEUTRAL;
    config_.minimum[i] = wire::PULSE_MINIMUM;
    config_.maximum[i] = wire::PULSE_MAXIMUM;
  }
  neutral();
}

void Gimbal::set(uint16_t flag, bool on) {
  flags_ = static_cast<uint16_t>(on ? flags_ | flag : flags_ & ~flag);
}

void Gimbal::neutral() {
  for (uint8_t i = 0; i < 3; ++i) pulse_[i] = config_.neutral[i];
  set(wire::FLAGS_DRIVING, false);
}

void Gimbal::boot(uint8_t reset_cause, uint32_t serial) {
  reset_cause_ = reset_cause;
  if (serial != wire::SERIAL_BLANK) serial_ = serial;
  transmit.push(0);  // ends whatever the line carried before
  hello();
}

void Gimbal::hello() {
  wire::Hello hello;
  hello.protocol = wire::PROTOCOL;
  hello.layout = wire::LAYOUT;
  memcpy(hello.firmware, wire::FIRMWARE, sizeof hello.firmware);
  hello.build = BUILD_HASH;
  hello.serial = serial_;
  hello.board = board_;
  hello.reset_cause = reset_cause_;
  memcpy(hello.servo_pins, wire::SERVO_PINS, sizeof hello.servo_pins);
  memcpy(hello.potentiometer_pins, wire::POTENTIOMETER_PINS, sizeof hello.potentiometer_pins);
  memcpy(hello.joystick_pins, wire::JOYSTICK_PINS, sizeof hello.joystick_pins);
  memcpy(hello.switch_pins, wire::SWITCH_PINS, sizeof hello.switch_pins);
  memcpy(hello.imu_addresses, wire::IMU_ADDRESSES, sizeof hello.imu_addresses);
  hello.tick_ns = wire::TICK_NS;
  hello.pwm_period_us = wire::PWM_PERIOD_US;
  hello.adc_levels = wire::ADC_LEVELS;
  hello.gyro_range_dps = wire::GYRO_RANGE_DPS;
  hello.accelerometer_range_g = wire::ACCELEROMETER_RANGE_G;
  hello.telemetry_period_ms = config_.telemetry_period_ms;
  hello.dlpf = config_.dlpf;
  memcpy(hello.neutral, config_.neutral, sizeof hello.neutral);
  memcpy(hello.minimum, config_.minimum, sizeof hello.minimum);
  memcpy(hello.maximum, config_.maximum, sizeof hello.maximum);
  memcpy(hello.imu_identity, imu_identity, sizeof hello.imu_identity);
  overruns_seen_ = overruns_;
  sender_.send(hello);
}

void Gimbal::obey(uint32_t received_us, uint32_t now_us) {
  if (follow(received_us, now_us)) acknowledged_ = receiver_.sequence();
}

bool Gimbal::follow(uint32_t received_us, uint32_t now_us) {
  const bool bare = receiver_.payload_size() == 0;
  bool obeyed = false;
  switch (receiver_.type()) {
    case wire::HelloRequest::TYPE:
      if (bare) hello();
      return bare;
    case wire::Ping::TYPE: {
      wire::Ping ping;
      if (!read(receiver_, ping)) return false;
      pong(ping, received_us, now_us);
      return true;
    }
    case wire::Arm::TYPE:
    case wire::Disarm::TYPE:
      if (bare) arm(receiver_.type() == wire::Arm::TYPE);
      obeyed = bare;
      break;
    case wire::Command::TYPE: {
      wire::Command message;
      obeyed = read(receiver_, message) && command(message, received_us);
      break;
    }
    case wire::Config::TYPE: {
      wire::Config message;
      obeyed = read(receiver_, message) && configure(message);
      break;
    }
    case wire::Name::TYPE: {
      wire::Name message;
      obeyed = read(receiver_, message) && name(message.serial);
      break;
    }
    default:
      break;
  }
  set(wire::FLAGS_REFUSED, !obeyed);
  return obeyed;
}

void Gimbal::arm(bool armed) {
  neutral();
  set(wire::FLAGS_ARMED, armed);
  if (armed) set(wire::FLAGS_TIMED_OUT, false);
}

bool Gimbal::command(const wire::Command& command, uint32_t received_us) {
  if (!armed() || command.timeout_ms == 0 || command.mode > wire::MODE_DRIVE) return false;
  set(wire::FLAGS_CLAMPED, false);
  if (command.mode == wire::MODE_NEUTRAL) {
    neutral();
    return true;
  }
  for (uint8_t i = 0; i < 3; ++i) {
    const uint16_t wanted = command.pulse[i] ? command.pulse[i] : config_.neutral[i];
    pulse_[i] = wanted < config_.minimum[i]   ? config_.minimum[i]
                : wanted > config_.maximum[i] ? config_.maximum[i]
                                              : wanted;
    if (pulse_[i] != wanted) set(wire::FLAGS_CLAMPED, true);
  }
  const uint16_t timeout_ms =
      command.timeout_ms < wire::TIMEOUT_LONGEST_MS ? command.timeout_ms : wire::TIMEOUT_LONGEST_MS;
  deadline_us_ = received_us + static_cast<uint32_t>(timeout_ms) * 1000;
  set(wire::FLAGS_DRIVING, true);
  return true;
}

bool Gimbal::configure(const wire::Config& config) {
  if (!plausible(config)) return false;
  config_ = config;
  neutral();  // pulses of the old limits end with them
  return true;
}

bool Gimbal::name(uint32_t serial) {
  if (serial_ != wire::SERIAL_NONE || serial == wire::SERIAL_NONE || serial == wire::SERIAL_BLANK)
    return false;
  serial_ = serial;
  return true;
}

void Gimbal::pong(const wire::Ping& ping, uint32_t received_us, uint32_t now_us) {
  // The answer is sent after everything queued, and after two bytes in the UART.
  const uint8_t queued = transmit.used();
  wire::Pong pong;
  pong.host_ns = ping.host_ns;
  pong.received_us = received_us;
  pong.sent_us = now_us + (queued ? (queued + 2) * BYTE_US : 0);
  sender_.send(pong);
}

void Gimbal::update(uint32_t now_us) {
  if (!(flags_ & wire::FLAGS_DRIVING)) return;
  if (static_cast<int32_t>(now_us - deadline_us_) < 0) return;
  neutral();
  set(wire::FLAGS_TIMED_OUT, true);
}

void Gimbal::report(const Sample& sample) {
  overruns_ = sample.overruns;
  set(wire::FLAGS_HOLDER_IMU, sample.imu_fresh[0]);
  set(wire::FLAGS_BASE_IMU, sample.imu_fresh[1]);
  set(wire::FLAGS_RECEIVE_OVERRUN, overruns_ != overruns_seen_);
  wire::Telemetry t;
  t.device_us = sample.device_us;
  t.frame_us = sample.frame_us;
  memcpy(t.potentiometer, sample.potentiometer, sizeof t.potentiometer);
  memcpy(t.holder_gyro, sample.gyro[0], sizeof t.holder_gyro);
  memcpy(t.holder_accelerometer, sample.accelerometer[0], sizeof t.holder_accelerometer);
  memcpy(t.base_gyro, sample.gyro[1], sizeof t.base_gyro);
  memcpy(t.base_accelerometer, sample.accelerometer[1], sizeof t.base_accelerometer);
  memcpy(t.imu_age_us, sample.imu_age_us, sizeof t.imu_age_us);
  memcpy(t.pulse, sample.pulse, sizeof t.pulse);
  t.switches = sample.switches;
  memcpy(t.joystick, sample.joystick, sizeof t.joystick);
  t.flags = flags_;
  t.crc_errors = receiver_.crc_errors;
  t.lost = receiver_.lost;
  t.overruns = sample.overruns;
  t.skipped = sender_.skipped;
  t.acknowledged = acknowledged_;
  sender_.send(t);
}
