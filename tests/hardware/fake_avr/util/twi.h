// Status codes: ATmega328P data sheet, tables 22-2 and 22-3.
#pragma once
#define TW_STATUS (TWSR & 0xF8)
enum { TW_START = 0x08, TW_REP_START = 0x10, TW_MT_SLA_ACK = 0x18, TW_MT_DATA_ACK = 0x28 };
enum { TW_MR_SLA_ACK = 0x40, TW_MR_DATA_ACK = 0x50, TW_MR_DATA_NACK = 0x58 };
