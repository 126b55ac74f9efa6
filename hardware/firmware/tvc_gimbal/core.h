// Behaviour of the rig without registers: frames to pulse widths and frames.
#pragma once
#include <stdint.h>

#include "framing.h"
#include "protocol.h"

// Sensor readings of one telemetry frame.
struct Sample {
  uint32_t device_us;
  uint16_t frame_us;
  uint16_t potentiometer[4];
  uint16_t joystick[2];
  int16_t gyro[2][3];  // holder, base
  int16_t accelerometer[2][3];
  uint16_t imu_age_us[2];
  bool imu_fresh[2];
  uint16_t pulse[3];  // in force, ticks
  uint8_t switches;
  uint16_t overruns;
};

class Gimbal {
 public:
  explicit Gimbal(uint8_t board);

  // Sends HELLO; `reset_cause` is MCUSR, `serial` the number in the board's memory.
  void boot(uint8_t reset_cause, uint32_t serial);
  // True when this byte has completed a frame: obey it before the next byte.
  bool receive(uint8_t byte) { return receiver_.take(byte); }
  // `received_us`: clock at the frame's last byte; `now_us`: clock now.
  void obey(uint32_t received_us, uint32_t now_us);
  void update(uint32_t now_us);
  void report(const Sample& sample);

  const uint16_t* pulse() const { return pulse_; }  // wanted, ticks
  bool armed() const { return flags_ & wire::FLAGS_ARMED; }
  uint8_t telemetry_period_ms() const { return config_.telemetry_period_ms; }
  uint8_t dlpf() const { return config_.dlpf; }
  uint32_t serial() const { return serial_; }  // serial number, to be kept by the board

  TransmitRing transmit;
  uint8_t imu_identity[2];  // set by the board

 private:
  void hello();
  bool follow(uint32_t received_us, uint32_t now_us);
  bool command(const wire::Command& command, uint32_t received_us);
  bool configure(const wire::Config& config);
  bool name(uint32_t serial);
  void pong(const wire::Ping& ping, uint32_t received_us, uint32_t now_us);
  void arm(bool armed);
  void neutral();
  void set(uint16_t flag, bool on);

  Receiver receiver_;
  Sender sender_;
  wire::Config config_;
  uint16_t pulse_[3];
  uint16_t flags_;
  uint16_t acknowledged_;
  uint16_t overruns_;  // as last reported by the board
  uint16_t overruns_seen_;  // at the latest HELLO
  uint32_t deadline_us_;
  uint32_t serial_;
  uint8_t board_;
  uint8_t reset_cause_;
};
