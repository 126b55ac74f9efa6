/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A Nano's surroundings for libsimavr, flat enough for ctypes: serial line, ADC pins, switches,
 * servo outputs and two MPU6050 on the I2C bus. Built on demand by hardware/simavr/nano.py, never shipped
 * as a binary; see NOTICE.md beside this file for why its licence differs from the project's.
 *
 * Written against simavr 1.6. Its defects, each with a workaround marked TRAP:
 *   - sleep() really sleeps;
 *   - Timer1 in mode 14 and Timer2's compare unit drive the wrong pin edges;
 *   - I2C bytes take 9 us at every bit rate;
 *   - a byte of the UART takes eleven bits, parity or not;
 *   - a low level on D2 or D3 costs a timer call per cycle, interrupt enabled or not;
 *   - a pull-up overrules a pin that is driven from outside, unless it is declared external;
 *   - the ADC scales millivolts, coarser than one code.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_interrupts.h>

enum { FREQUENCY = 16000000, QUEUE = 1 << 14, EDGES = 1 << 10, IMUS = 2, REGISTERS = 128 };

/* ATmega328P data addresses. */
enum {
  DDRB_ = 0x24, DDRD_ = 0x2A, TCCR1A_ = 0x80, OCR1AL_ = 0x88, OCR1BL_ = 0x8A,
  TCCR2A_ = 0xB0, TWBR_ = 0xB8, TWSR_ = 0xB9, MCUSR_ = 0x54
};
enum { EXTRF = 1 << 1 };
enum { TIMER2_COMPB_VECTOR = 8, TIMER1_OVF_VECTOR = 13 };
enum { FULL_SCALE = 1023, INPUTS_D = 0xB4 /* D2, D4, D5, D7: limit switches */ };

enum { MPU_PWR_MGMT_1 = 0x6B, MPU_SLEEP = 0x40, MPU_FIRST = 0x3B, MPU_READING = 14 };

typedef struct {
  uint8_t reg[REGISTERS];
  uint8_t latched[MPU_READING]; /* a burst reads one sample */
  uint8_t pointer;
  uint8_t present;
} imu_t;

typedef struct {
  uint64_t cycle;
  uint32_t channel;
  uint32_t width; /* ticks of 0.5 us */
} pulse_t;

typedef struct {
  uint8_t byte;
  uint64_t cycle; /* at which its stop bit is through */
} stamped_t;

typedef struct nano {
  avr_t *avr;
  avr_twi_t *twi;
  avr_uart_t *uart;
  avr_irq_t *uart_in, *adc[8], *twi_in, *pin_d[8];
  uint32_t adc_code[8], pin_level[8];

  uint8_t in[QUEUE];
  uint32_t in_head, in_tail;
  int in_running;
  stamped_t out[QUEUE];
  uint32_t out_head, out_tail;
  uint64_t out_free; /* when the transmit line is idle again */
    uint32_t byte_cycles;

  pulse_t pulses[EDGES];
  uint32_t pulse_head, pulse_tail;
  uint64_t d3_rise;
  int d3_high;

  imu_t imu[IMUS];
  int bus_stuck; /* SDA is held: no transaction ends */
  int selected; /* sensor on the bus, or -1 */
  int expect_register;
} nano_t;

static int the_bus_stuck;
static avr_twi_t *the_twi; /* by which the timer below identifies its caller */

/* TRAP: stands before the library's function of this name in symbol lookup. I2C calls it with the
 * number of bus clocks as if they were microseconds; all other callers mean microseconds. */
void avr_cycle_timer_register_usec(avr_t *avr, uint32_t usec, avr_cycle_timer_t timer, void *param) {
  if (the_twi && param == the_twi && the_bus_stuck) return; /* it would raise TWINT */
  avr_cycle_count_t cycles = (avr_cycle_count_t)usec * (FREQUENCY / 1000000);
  if (the_twi && param == the_twi) {
    uint32_t clock = 16u + (2u * avr->data[TWBR_] << (2 * (avr->data[TWSR_] & 3)));
    cycles = (avr_cycle_count_t)usec * clock;
  }
  avr_cycle_timer_register(avr, cycles, timer, param);
}

static void no_sleep(avr_t *avr, avr_cycle_count_t cycles) {
  (void)avr;
  (void)cycles;
}

static void silent(avr_t *avr, const int level, const char *format, va_list arguments) {
  (void)avr;
  (void)level;
  (void)format;
  (void)arguments;
}

/* ---- serial line ---- */

static avr_cycle_count_t feed(avr_t *avr, avr_cycle_count_t when, void *param) {
  nano_t *n = param;
  (void)avr;
  if (n->in_head == n->in_tail) {
    n->in_running = 0;
    return 0;
  }
  n->uart->cycles_per_byte = n->byte_cycles; /* TRAP: its own value depends on UBRR0 */
  avr_raise_irq(n->uart_in, n->in[n->in_tail++ % QUEUE]);
  return when + n->byte_cycles;
}

static void transmitted(avr_irq_t *irq, uint32_t value, void *param) {
  nano_t *n = param;
  (void)irq;
  n->uart->cycles_per_byte = n->byte_cycles;
  uint64_t start = n->avr->cycle > n->out_free ? n->avr->cycle : n->out_free;
  n->out_free = start + n->byte_cycles;
  if (n->out_head - n->out_tail == QUEUE) {
    n->out_tail++;
  }
  stamped_t *slot = &n->out[n->out_head++ % QUEUE];
  slot->byte = (uint8_t)value;
  slot->cycle = n->out_free;
}

/* ---- servo outputs ---- */

static void pulse(nano_t *n, uint64_t cycle, uint32_t channel, uint32_t width) {
  if (n->pulse_head - n->pulse_tail == EDGES) n->pulse_tail++;
  pulse_t *slot = &n->pulses[n->pulse_head++ % EDGES];
  slot->cycle = cycle;
  slot->channel = channel;
  slot->width = width;
}

static uint32_t word16(nano_t *n, int at) { return n->avr->data[at] | n->avr->data[at + 1] << 8; }

/* TRAP: Timer1's pins. At the overflow the hardware puts OCR1A and OCR1B into force and raises
 * the pins set to it; the pulse is OCR + 1 ticks long. */
static void frame_started(avr_irq_t *irq, uint32_t value, void *param) {
  nano_t *n = param;
  (void)irq;
  if (!value) return;
  uint8_t mode = n->avr->data[TCCR1A_], direction = n->avr->data[DDRB_];
  if ((mode >> 6) == 2 && direction & 1 << 1) pulse(n, n->avr->cycle, 0, word16(n, OCR1AL_) + 1);
  if ((mode >> 4 & 3) == 2 && direction & 1 << 2) pulse(n, n->avr->cycle, 1, word16(n, OCR1BL_) + 1);
}

/* TRAP: Timer2's pin. Each match changes D3 by the present setting of COM2B. */
static void timer2_matched(avr_irq_t *irq, uint32_t value, void *param) {
  nano_t *n = param;
  (void)irq;
  if (!value) return;
  uint8_t action = n->avr->data[TCCR2A_] >> 4 & 3;
  if (action == 3 && !n->d3_high) {
    n->d3_high = 1;
    n->d3_rise = n->avr->cycle;
  } else if (action == 2 && n->d3_high) {
    n->d3_high = 0;
    if (n->avr->data[DDRD_] & 1 << 3)
      pulse(n, n->d3_rise, 2, (uint32_t)((n->avr->cycle - n->d3_rise + 4) / 8));
  }
}

/* ---- sensors ---- */

static uint8_t imu_read(imu_t *s) {
  uint8_t at = s->pointer++ % REGISTERS;
  if (at < MPU_FIRST || at >= MPU_FIRST + MPU_READING) return s->reg[at];
  return s->reg[MPU_PWR_MGMT_1] & MPU_SLEEP ? 0 : s->latched[at - MPU_FIRST];
}

static void acknowledge(nano_t *n, uint8_t address) {
  avr_raise_irq(n->twi_in, avr_twi_irq_msg(TWI_COND_ACK, address, 1));
}

static void bus_event(avr_irq_t *irq, uint32_t value, void *param) {
  nano_t *n = param;
  avr_twi_msg_irq_t message;
  (void)irq;
  // cppcheck-suppress unreadVariable ; the union's other member reads it
  message.u.v = value;
  uint8_t what = message.u.twi.msg, address = message.u.twi.addr;
  if (what & TWI_COND_STOP) n->selected = -1;
  if (what & TWI_COND_START) {
    int i = (address >> 1) - 0x68;
    int fresh = n->selected != i; /* a repeated START belongs to the transaction before it */
    n->selected = i >= 0 && i < IMUS && n->imu[i].present ? i : -1;
    n->expect_register = !(address & 1);
    if (n->selected < 0) return;
    if (fresh) memcpy(n->imu[i].latched, n->imu[i].reg + MPU_FIRST, MPU_READING);
    acknowledge(n, address);
  }
  if (n->selected < 0) return;
  imu_t *s = &n->imu[n->selected];
  if (what & TWI_COND_WRITE) {
    if (n->expect_register)
      s->pointer = message.u.twi.data;
    else
      s->reg[s->pointer++ % REGISTERS] = message.u.twi.data;
    n->expect_register = 0;
    acknowledge(n, address);
  }
  if (what & TWI_COND_READ)
    avr_raise_irq(n->twi_in, avr_twi_irq_msg(TWI_COND_READ, address, imu_read(s)));
}

static void conversion(avr_irq_t *irq, uint32_t value, void *param) {
  nano_t *n = param;
  avr_adc_mux_t mux = {0}; /* 8 bytes of which the message carries 4 */
  (void)irq;
  memcpy(&mux, &value, sizeof value);
  if (mux.kind == ADC_MUX_SINGLE && mux.src < 8) avr_raise_irq(n->adc[mux.src], n->adc_code[mux.src]);
}

/* ---- creation, reset, time ---- */

static void imu_reset(imu_t *s) {
  uint8_t present = s->present;
  memset(s, 0, sizeof *s);
  s->present = present;
  s->reg[MPU_PWR_MGMT_1] = MPU_SLEEP;
  s->reg[0x75] = 0x68; /* WHO_AM_I of either address */
}

static void wire_up(nano_t *n) {
  avr_t *avr = n->avr;
  n->uart_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
  n->twi_in = avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_INPUT);
  for (int i = 0; i < 8; i++) {
    n->adc[i] = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + i);
    n->pin_d[i] = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), i);
  }
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), transmitted, n);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_OUTPUT), bus_event, n);
  avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER), conversion, n);
  avr_irq_register_notify(avr_get_interrupt_irq(avr, TIMER1_OVF_VECTOR), frame_started, n);
  avr_irq_register_notify(avr_get_interrupt_irq(avr, TIMER2_COMPB_VECTOR), timer2_matched, n);
  for (avr_io_t *io = avr->io_port; io; io = io->next)
    if (strcmp(io->kind, "twi") == 0)
      n->twi = (avr_twi_t *)io;
    else if (strcmp(io->kind, "uart") == 0)
      n->uart = (avr_uart_t *)io;
  the_twi = n->twi;
  uint32_t flags = 0; /* no printing, no polling pauses */
  avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
}

/* TRAP: declared external, or the firmware's pull-up wins; and a level that does not change is not
 * passed on, so the other one goes first. */
static void drive_pins(nano_t *n) {
  avr_ioport_external_t outside = {.name = 'D', .mask = INPUTS_D, .value = 0};
  for (int i = 0; i < 8; i++)
    if (INPUTS_D >> i & 1 && n->pin_level[i]) outside.value |= 1u << i;
  avr_ioctl(n->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);
  for (int i = 0; i < 8; i++) {
    if (!(INPUTS_D >> i & 1)) continue;
    avr_raise_irq(n->pin_d[i], !n->pin_level[i]);
    avr_raise_irq(n->pin_d[i], n->pin_level[i]);
  }
}

void nano_set_pin_d(nano_t *n, uint32_t pin, uint32_t level) {
  if (pin >= 8 || !(INPUTS_D >> pin & 1) || n->pin_level[pin] == !!level) return;
  n->pin_level[pin] = !!level;
  drive_pins(n);
}

/* Restores what a reset of the chip clears of its surroundings. */
static void settle(nano_t *n) {
  for (int i = 0; i < 2; i++) avr_extint_set_strict_lvl_trig(n->avr, i, 0); /* TRAP: see top */
  drive_pins(n);
}

/* NULL if the file is not an AVR program or the chip is unknown. */
nano_t *nano_open(const char *path, uint32_t baud) {
  elf_firmware_t firmware;
  memset(&firmware, 0, sizeof firmware);
  avr_global_logger_set(silent);
  if (elf_read_firmware(path, &firmware) != 0) return NULL;
  nano_t *n = calloc(1, sizeof *n);
  n->avr = avr_make_mcu_by_name("atmega328p");
  if (!n->avr) {
    free(n);
    return NULL;
  }
  avr_init(n->avr);
  firmware.frequency = FREQUENCY;
  avr_load_firmware(n->avr, &firmware);
  n->avr->frequency = FREQUENCY;
  n->avr->sleep = no_sleep;
  /* TRAP: code = input * 1023 / reference; with this reference the input is the code itself. */
  n->avr->vcc = n->avr->avcc = n->avr->aref = FULL_SCALE;
  n->byte_cycles = 10u * FREQUENCY / baud;
  n->selected = -1;
  for (int i = 0; i < IMUS; i++) {
    n->imu[i].present = 1;
    imu_reset(&n->imu[i]);
  }
  wire_up(n);
  for (int i = 0; i < 8; i++) n->pin_level[i] = 1;
  settle(n);
  return n;
}

void nano_close(nano_t *n) {
  if (the_twi == n->twi) the_twi = NULL;
  avr_terminate(n->avr);
  free(n->avr);
  free(n);
}

/* What the DTR line does when a port is opened: program and bytes in transit restart, the clock
 * and everything outside the chip continue. */
void nano_reset(nano_t *n) {
  avr_reset(n->avr);
  n->avr->data[MCUSR_] = EXTRF;
  n->in_head = n->in_tail = n->out_head = n->out_tail = 0;
  n->in_running = n->d3_high = 0;
  n->selected = -1;
  settle(n);
}

/* A reset through Optiboot, which clears MCUSR and passes it on in r2. */
void nano_boot(nano_t *n, uint32_t mcusr) {
  nano_reset(n);
  n->avr->data[MCUSR_] = 0;
  n->avr->data[2] = (uint8_t)mcusr;
}

uint64_t nano_cycle(nano_t *n) { return n->avr->cycle; }

static avr_cycle_count_t stop_here(avr_t *avr, avr_cycle_count_t when, void *param) {
  (void)avr;
  (void)when;
  (void)param;
  return 0;
}

/* Runs until the clock shows `cycle`; 0, or -1 when the program has crashed or ended. */
int nano_run_until(nano_t *n, uint64_t cycle) {
  avr_t *avr = n->avr;
  the_twi = n->twi;
  the_bus_stuck = n->bus_stuck;
  if (cycle <= avr->cycle) return 0;
  avr_cycle_timer_register(avr, cycle - avr->cycle, stop_here, n); /* ends a sleep on time */
  while (avr->cycle < cycle) {
    int state = avr_run(avr);
    if (state == cpu_Done || state == cpu_Crashed) return -1;
  }
  return 0;
}

/* Bytes taken, fewer than `size` when the queue is full. */
uint32_t nano_write(nano_t *n, const uint8_t *bytes, uint32_t size) {
  uint32_t taken = 0;
  while (taken < size && n->in_head - n->in_tail < QUEUE) n->in[n->in_head++ % QUEUE] = bytes[taken++];
  if (taken && !n->in_running) {
    n->in_running = 1;
    avr_cycle_timer_register(n->avr, 1, feed, n);
  }
  return taken;
}

/* Bytes whose stop bit has passed by now. */
uint32_t nano_read(nano_t *n, uint8_t *bytes, uint32_t size) {
  uint32_t given = 0;
  while (given < size && n->out_tail != n->out_head) {
    stamped_t *slot = &n->out[n->out_tail % QUEUE];
    if (slot->cycle > n->avr->cycle) break;
    bytes[given++] = slot->byte;
    n->out_tail++;
  }
  return given;
}

/* What the EEPROM holds from `at` on. */
void nano_set_eeprom(nano_t *n, uint32_t at, uint8_t *bytes, uint32_t size) {
  avr_eeprom_desc_t place = {.ee = bytes, .offset = (uint16_t)at, .size = size};
  avr_ioctl(n->avr, AVR_IOCTL_EEPROM_SET, &place);
}

void nano_set_adc(nano_t *n, const uint16_t *codes) {
  for (int i = 0; i < 8; i++) n->adc_code[i] = codes[i];
}

void nano_set_imu(nano_t *n, uint32_t sensor, const uint8_t *reading) {
  if (sensor < IMUS) memcpy(n->imu[sensor].reg + MPU_FIRST, reading, MPU_READING);
}

/* Plugs a sensor in, asleep as after power-up, or pulls it. */
void nano_plug_imu(nano_t *n, uint32_t sensor, uint32_t present) {
  if (sensor >= IMUS) return;
  n->imu[sensor].present = present ? 1 : 0;
  imu_reset(&n->imu[sensor]);
}

/* Holds the bus, so that no transaction ends, or releases it. */
void nano_hold_bus(nano_t *n, uint32_t held) { n->bus_stuck = held ? 1 : 0; }

/* Sends the program where it ends, interrupts off: to test the watchdog. */
void nano_hang(nano_t *n) {
  avr_t *avr = n->avr;
  for (uint32_t at = 0; at + 3 < avr->flashend; at += 2)
    if (avr->flash[at] == 0xF8 && avr->flash[at + 1] == 0x94 && avr->flash[at + 2] == 0xFF &&
        avr->flash[at + 3] == 0xCF) { /* cli; rjmp to itself */
      avr->pc = at;
      return;
    }
}

uint32_t nano_imu_register(nano_t *n, uint32_t sensor, uint32_t reg) {
  return sensor < IMUS && reg < REGISTERS ? n->imu[sensor].reg[reg] : 0;
}

/* The pulses that have begun (D3: ended) since the last call. */
uint32_t nano_pulses(nano_t *n, pulse_t *pulses, uint32_t size) {
  uint32_t given = 0;
  while (given < size && n->pulse_tail != n->pulse_head) pulses[given++] = n->pulses[n->pulse_tail++ % EDGES];
  return given;
}
