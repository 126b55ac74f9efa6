// Runs the firmware's portable core on the host: one command a line in, one answer a line out.
// Built by core.py, with AddressSanitizer and UBSan or to count which lines run.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include <iostream>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include "core.h"
#include "imu.h"

namespace {

Gimbal gimbal(wire::BOARD_NANO);
Imus imus;
constexpr int ALL = 1 << 16;
int room = ALL;  // bytes that the line takes with the next answer

std::vector<uint8_t> bytes(const std::string& hex) {
  std::vector<uint8_t> out;
  for (size_t i = 0; i + 1 < hex.size(); i += 2)
    out.push_back(static_cast<uint8_t>(strtoul(hex.substr(i, 2).c_str(), nullptr, 16)));
  return out;
}

template <class T>
void numbers(std::istream& in, T* out, int count) {
  for (int i = 0; i < count; ++i) {
    long value = 0;
    in >> value;
    out[i] = static_cast<T>(value);
  }
}

Sample sample(std::istream& in) {
  Sample s = {};
  numbers(in, &s.device_us, 1);
  numbers(in, &s.frame_us, 1);
  numbers(in, s.potentiometer, 4);
  numbers(in, s.joystick, 2);
  for (int i = 0; i < 2; ++i) {
    numbers(in, s.gyro[i], 3);
    numbers(in, s.accelerometer[i], 3);
  }
  numbers(in, s.imu_age_us, 2);
  numbers(in, s.imu_fresh, 2);
  numbers(in, s.pulse, 3);
  numbers(in, &s.switches, 1);
  numbers(in, &s.overruns, 1);
  return s;
}

void answer() {
  std::string hex = "-";
  uint8_t byte;
  char text[3];
  for (int left = room; left > 0 && gimbal.transmit.pop(byte); --left) {
    snprintf(text, sizeof text, "%02x", byte);
    hex += text;
  }
  const uint16_t* p = gimbal.pulse();
  std::cout << hex << ' ' << p[0] << ' ' << p[1] << ' ' << p[2] << ' ' << gimbal.armed() << ' '
            << unsigned(gimbal.telemetry_period_ms()) << ' ' << unsigned(gimbal.dlpf()) << ' '
            << gimbal.serial() << std::endl;
}

void answer_imu() {
  Transaction t = {};
  const bool more = imus.next(t);
  std::cout << more << ' ' << unsigned(t.address) << ' ' << unsigned(t.reg) << ' '
            << unsigned(t.value) << ' ' << unsigned(t.count);
  for (int i = 0; i < Imus::COUNT; ++i) {
    std::cout << ' ' << imus.fresh[i] << ' ' << imus.read_us[i];
    for (int axis = 0; axis < 3; ++axis) std::cout << ' ' << imus.gyro[i][axis];
    for (int axis = 0; axis < 3; ++axis) std::cout << ' ' << imus.accelerometer[i][axis];
  }
  std::cout << std::endl;
}

}  // namespace

int main() {
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream in(line);
    std::string verb, hex;
    uint32_t received = 0, now = 0;
    in >> verb;
    if (verb == "new") {
      gimbal.~Gimbal();
      new (&gimbal) Gimbal(wire::BOARD_NANO);
      room = ALL;
    } else if (verb == "boot") {
      in >> now;
      uint32_t serial = 0;
      in >> serial;
      gimbal.boot(static_cast<uint8_t>(now), serial);
    } else if (verb == "receive") {
      in >> received >> now >> hex;
      for (uint8_t byte : bytes(hex))
        if (gimbal.receive(byte)) gimbal.obey(received, now);
    } else if (verb == "update") {
      in >> now;
      gimbal.update(now);
    } else if (verb == "report") {
      gimbal.report(sample(in));
    } else if (verb == "room") {
      in >> room;
    } else if (verb == "imu_new") {
      imus = Imus();
    } else if (verb == "imu_begin") {
      imus.begin();
    } else if (verb == "imu_configure") {
      in >> now;
      imus.configure(static_cast<uint8_t>(now));
    } else if (verb == "imu_done") {
      bool ok = false;
      in >> ok >> now >> hex;
      const std::vector<uint8_t> data = bytes(hex);
      imus.done(ok, data.data(), now);
    }
    if (verb.compare(0, 4, "imu_") == 0)
      answer_imu();
    else
      answer();
  }
  return 0;
}
