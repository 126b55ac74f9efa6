// Generated from hardware/protocol by `python -m hardware.firmware`; edit that instead.
#pragma once
#include <stdint.h>

namespace wire {

static constexpr uint16_t PROTOCOL = 1;
static constexpr uint32_t BAUD = 500000;
static constexpr uint32_t CLOCK_HZ = 16000000;
static constexpr uint16_t TICK_NS = 500;
static constexpr uint16_t PWM_PERIOD_US = 20000;
static constexpr uint16_t PULSE_NEUTRAL = 3000;
static constexpr uint16_t PULSE_MINIMUM = 2000;
static constexpr uint16_t PULSE_MAXIMUM = 4000;
static constexpr uint16_t PULSE_LOWEST = 1000;
static constexpr uint16_t PULSE_HIGHEST = 5000;
static constexpr uint16_t TIMEOUT_LONGEST_MS = 2000;
static constexpr uint8_t TELEMETRY_PERIOD_MS = 2;
static constexpr uint8_t TELEMETRY_PERIOD_SHORTEST_MS = 2;
static constexpr uint8_t TELEMETRY_PERIOD_LONGEST_MS = 250;
static constexpr uint16_t ADC_LEVELS = 1024;
static constexpr uint16_t GYRO_RANGE_DPS = 500;
static constexpr uint8_t ACCELEROMETER_RANGE_G = 4;
static constexpr uint32_t SERIAL_NONE = 0;
static constexpr uint32_t SERIAL_BLANK = 4294967295;
static constexpr uint8_t DLPF = 2;
static constexpr uint8_t DLPF_HIGHEST = 6;
static constexpr uint16_t LAYOUT = 0xb24d;
static constexpr uint8_t MAX_PAYLOAD = 96;
static constexpr uint8_t MAX_ENCODED = 102;
static constexpr uint8_t FIRMWARE[] = {1, 0, 0};
static constexpr uint8_t SERVO_PINS[] = {9, 10, 3};
static constexpr uint8_t POTENTIOMETER_PINS[] = {14, 15, 16, 17};
static constexpr uint8_t JOYSTICK_PINS[] = {20, 21};
static constexpr uint8_t SWITCH_PINS[] = {2, 4, 5, 7};
static constexpr uint8_t IMU_ADDRESSES[] = {104, 105};

enum Board : uint8_t { BOARD_NANO = 1, BOARD_EMULATOR = 2, BOARD_RASPBERRY_PI = 3 };

enum Mode : uint8_t { MODE_NEUTRAL = 0, MODE_DRIVE = 1 };

enum Flags : uint16_t { FLAGS_ARMED = 1, FLAGS_DRIVING = 2, FLAGS_TIMED_OUT = 4, FLAGS_CLAMPED = 8, FLAGS_REFUSED = 16, FLAGS_HOLDER_IMU = 32, FLAGS_BASE_IMU = 64, FLAGS_RECEIVE_OVERRUN = 128, FLAGS_PULSE_UNTIMED = 256 };

// Requests HELLO.
struct __attribute__((packed)) HelloRequest {
  enum : uint8_t { TYPE = 0x01 };
};

// Pulse widths to drive until the next command or the timeout.
struct __attribute__((packed)) Command {
  enum : uint8_t { TYPE = 0x02 };
  uint16_t pulse[3];  // [0.5 µs] servo x, servo y, turntable; 0 for neutral
  uint16_t timeout_ms;  // [ms] neutral if no command follows within it; 1…2000
  uint8_t mode;  // 0 neutral, 1 drive
};
static_assert(sizeof(Command) == 9, "padded");

// Requests PONG.
struct __attribute__((packed)) Ping {
  enum : uint8_t { TYPE = 0x03 };
  uint64_t host_ns;  // [ns] time stamp of the host's clock
};
static_assert(sizeof(Ping) == 8, "padded");

// Enables commands; clears TIMED_OUT.
struct __attribute__((packed)) Arm {
  enum : uint8_t { TYPE = 0x04 };
};

// Servos to neutral; disables commands.
struct __attribute__((packed)) Disarm {
  enum : uint8_t { TYPE = 0x05 };
};

// Settings; refused as a whole if one is out of range.
struct __attribute__((packed)) Config {
  enum : uint8_t { TYPE = 0x06 };
  uint8_t telemetry_period_ms;  // [ms] 2…250
  uint8_t dlpf;  // low-pass setting of both IMUs, 0…6
  uint16_t neutral[3];  // [0.5 µs] servo x, servo y, turntable; within the limits
  uint16_t minimum[3];  // [0.5 µs] servo x, servo y, turntable; 1000 or more
  uint16_t maximum[3];  // [0.5 µs] servo x, servo y, turntable; 5000 or less
};
static_assert(sizeof(Config) == 20, "padded");

// Serial number for a board without one, kept without power; refused by a board with one.
struct __attribute__((packed)) Name {
  enum : uint8_t { TYPE = 0x07 };
  uint32_t serial;  // 1…0xFFFFFFFE
};
static_assert(sizeof(Name) == 4, "padded");

// Identity, versions, scales and settings of the board; sent at boot and on request.
struct __attribute__((packed)) Hello {
  enum : uint8_t { TYPE = 0x81 };
  uint16_t protocol;  // version of the protocol
  uint16_t layout;  // checksum of the message table
  uint8_t firmware[3];  // version: major, minor, patch
  uint32_t build;  // first four bytes of the sources' SHA-256
  uint32_t serial;  // serial number of the board; 0 without one
  uint8_t board;  // 1 Nano, 2 emulator, 3 Raspberry Pi
  uint8_t reset_cause;  // MCUSR: bit 0 power, 1 reset pin, 2 brown-out, 3 watchdog; 0 unknown
  uint8_t servo_pins[3];  // servo x, servo y, turntable
  uint8_t potentiometer_pins[4];  // x_a, x_b, y_a, y_b
  uint8_t joystick_pins[2];  // x, y
  uint8_t switch_pins[4];  // +x, -x, +y, -y
  uint8_t imu_addresses[2];  // holder, base
  uint16_t tick_ns;  // [ns] unit of pulse widths
  uint16_t pwm_period_us;  // [µs] servo frame
  uint16_t adc_levels;  // codes at full supply
  uint16_t gyro_range_dps;  // [°/s] 32768 counts
  uint8_t accelerometer_range_g;  // [g] 32768 counts
  uint8_t telemetry_period_ms;  // [ms] as configured
  uint8_t dlpf;  // low-pass setting of both IMUs
  uint16_t neutral[3];  // [0.5 µs] servo x, servo y, turntable
  uint16_t minimum[3];  // [0.5 µs] servo x, servo y, turntable
  uint16_t maximum[3];  // [0.5 µs] servo x, servo y, turntable
  uint8_t imu_identity[2];  // WHO_AM_I of holder and base: 0x68 MPU6050, 0x70 MPU6500; 0 unread
};
static_assert(sizeof(Hello) == 63, "padded");

// One sample of all sensors, with status and counters.
struct __attribute__((packed)) Telemetry {
  enum : uint8_t { TYPE = 0x82 };
  uint32_t device_us;  // [µs] device clock at the sample; wraps
  uint16_t frame_us;  // [µs] age of the running PWM frame at the sample
  uint16_t potentiometer[4];  // [1/1024] x_a, x_b, y_a, y_b
  int16_t holder_gyro[3];  // [count] MPU6050 axes x, y, z
  int16_t holder_accelerometer[3];  // [count] MPU6050 axes x, y, z
  int16_t base_gyro[3];  // [count] MPU6050 axes x, y, z
  int16_t base_accelerometer[3];  // [count] MPU6050 axes x, y, z
  uint16_t imu_age_us[2];  // [µs] age of holder and base reading at the sample
  uint16_t pulse[3];  // [0.5 µs] in force: servo x, servo y, turntable
  uint8_t switches;  // bits 0…3 closed: +x, -x, +y, -y
  uint16_t joystick[2];  // [1/1024] x, y
  uint16_t flags;  // bits of `Flags`
  uint16_t crc_errors;  // frames from the host that failed; wraps
  uint16_t lost;  // sequence numbers missed from the host; wraps
  uint16_t overruns;  // bytes from the host lost for lack of room; wraps
  uint16_t skipped;  // frames to the host dropped for lack of room; wraps
  uint16_t acknowledged;  // sequence number of the last host frame obeyed
};
static_assert(sizeof(Telemetry) == 65, "padded");

// Answer to PING, for clock offset and skew.
struct __attribute__((packed)) Pong {
  enum : uint8_t { TYPE = 0x83 };
  uint64_t host_ns;  // [ns] as received
  uint32_t received_us;  // [µs] device clock at PING's last byte
  uint32_t sent_us;  // [µs] device clock at PONG's first byte
};
static_assert(sizeof(Pong) == 16, "padded");

}  // namespace wire
