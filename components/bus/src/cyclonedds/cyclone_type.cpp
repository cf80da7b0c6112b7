// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cyclone_type.hpp"

#include "../message_info.hpp"
#include "pacer.hpp"
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>
#include <dds/version.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

// dds/ddsi/* changes from one release to the next: its structs gained fields in 0.10 and functions
// in 0.11. Read the three headers above again before another version is let in.
static_assert(DDS_VERSION_MAJOR == 0 && DDS_VERSION_MINOR == 10,
              "this backend is written for Cyclone DDS 0.10, as Debian 12 has it");

namespace trigpoint::bus::cyclonedds {

namespace {

constexpr std::size_t kEncapsulation_bytes = 4;

struct SerType : ddsi_sertype {
  std::shared_ptr<BufferPool> pool;
};

/// Everything but `pacer` is written before others see it.
struct SerData : ddsi_serdata {
  std::shared_ptr<BufferPool> pool;  // data may outlive its type
  Buffer buffer;                     // zeros behind `size`, up to a multiple of four
  std::uint32_t size{0};             // with encapsulation
  std::atomic<Pacer*> pacer{nullptr};
};

SerData& mine(ddsi_serdata* data) {
  return *static_cast<SerData*>(data);
}

const SerData& mine(const ddsi_serdata* data) {
  return *static_cast<const SerData*>(data);
}

/// What a message without content has on the wire: little-endian CDR of no bytes.
void write_encapsulation(std::uint8_t* bytes) {
  constexpr std::uint8_t kLittleEndianCdr[kEncapsulation_bytes] = {0, 1, 0, 0};
  std::memcpy(bytes, kLittleEndianCdr, kEncapsulation_bytes);
}

// Cyclone takes whole words, from the end of the message too.
void end_at(SerData& data, std::size_t size) {
  data.size = static_cast<std::uint32_t>(size);
  std::memset(data.buffer.bytes.get() + size, 0, (4 - size % 4) % 4);
}

SerData* make_data(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t size) {
  auto data = std::make_unique<SerData>();
  ddsi_serdata_init(data.get(), type, kind);
  data->pool = static_cast<const SerType*>(type)->pool;
  data->buffer = data->pool->take(std::max(size, kEncapsulation_bytes) + 3);
  end_at(*data, size);
  return data.release();
}

// ---- what Cyclone calls: data -------------------------------------------------------------------
// None of these may throw into C: `noexcept` turns the only possible case, no memory, into an end
// with a message, as Cyclone's own allocator does.

bool have_equal_keys(const ddsi_serdata*, const ddsi_serdata*) noexcept {
  return true;  // no type here has a key
}

std::uint32_t size_of(const ddsi_serdata* data) noexcept {
  return mine(data).size;
}

void free_data(ddsi_serdata* data) noexcept {
  const std::unique_ptr<SerData> owned(&mine(data));
  owned->pool->give_back(std::move(owned->buffer));
}

ddsi_serdata* from_fragments(const ddsi_sertype* type,
                             ddsi_serdata_kind kind,
                             const nn_rdata* fragment,
                             std::size_t size) noexcept {
  SerData* data = make_data(type, kind, size);
  std::uint32_t filled = 0;
  for (; fragment != nullptr; fragment = fragment->nextfrag) {
    const std::uint32_t end = std::min(fragment->maxp1, data->size);
    if (fragment->min > filled) {
      break;  // a hole
    }
    if (end > filled) {  // fragments may overlap
      const unsigned char* payload =
          NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
      std::memcpy(
          data->buffer.bytes.get() + filled, payload + (filled - fragment->min), end - filled);
      filled = end;
    }
  }
  end_at(*data, filled);
  return data;
}

ddsi_serdata* from_pieces(const ddsi_sertype* type,
                          ddsi_serdata_kind kind,
                          ddsrt_msg_iovlen_t count,
                          const ddsrt_iovec_t* pieces,
                          std::size_t size) noexcept {
  SerData* data = make_data(type, kind, size);
  std::size_t filled = 0;
  for (ddsrt_msg_iovlen_t i = 0; i < count; ++i) {
    const std::size_t bytes = std::min(pieces[i].iov_len, size - filled);
    std::memcpy(data->buffer.bytes.get() + filled, pieces[i].iov_base, bytes);
    filled += bytes;
  }
  end_at(*data, filled);
  return data;
}

ddsi_serdata* without_content(const ddsi_sertype* type, ddsi_serdata_kind kind) {
  SerData* data = make_data(type, kind, kEncapsulation_bytes);
  write_encapsulation(data->buffer.bytes.get());
  return data;
}

ddsi_serdata* from_key_hash(const ddsi_sertype* type, const ddsi_keyhash*) noexcept {
  return without_content(type, SDK_KEY);
}

ddsi_serdata* from_sample(const ddsi_sertype* type,
                          ddsi_serdata_kind kind,
                          const void* sample) noexcept {
  if (kind != SDK_DATA) {
    return without_content(type, kind);
  }
  const auto& wire = *static_cast<const WireSample*>(sample);
  const std::size_t bound = wire.ops->size_bound(wire.value);
  SerData* data = make_data(type, kind, bound);
  const std::size_t size = wire.ops->serialize(wire.value, {data->buffer.bytes.get(), bound});
  if (size < kEncapsulation_bytes) {
    ddsi_serdata_unref(data);
    return nullptr;
  }
  end_at(*data, size);
  return data;
}

void copy_bytes(const ddsi_serdata* data, std::size_t begin, std::size_t size, void* out) noexcept {
  std::memcpy(out, mine(data).buffer.bytes.get() + begin, size);
}

/// Asked for each datagram as it is sent.
ddsi_serdata* borrow_bytes(const ddsi_serdata* data,
                           std::size_t begin,
                           std::size_t size,
                           ddsrt_iovec_t* out) noexcept {
  if (Pacer* pacer = mine(data).pacer) {
    pacer->before_sending(size);
  }
  out->iov_base = mine(data).buffer.bytes.get() + begin;
  out->iov_len = size;
  return ddsi_serdata_ref(data);
}

void return_bytes(ddsi_serdata* data, const ddsrt_iovec_t*) noexcept {
  ddsi_serdata_unref(data);
}

bool to_sample(const ddsi_serdata*, void*, void**, void*) noexcept {
  return false;  // our readers take the bytes
}

ddsi_serdata* to_untyped(const ddsi_serdata* data) noexcept {
  ddsi_serdata* key = without_content(data->type, SDK_KEY);
  key->type = nullptr;
  return key;
}

bool untyped_to_sample(const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) noexcept {
  return true;
}

std::size_t print_data(const ddsi_sertype*,
                       const ddsi_serdata* data,
                       char* text,
                       std::size_t size) noexcept {
  return static_cast<std::size_t>(std::snprintf(text, size, "%u bytes", mine(data).size));
}

void key_hash(const ddsi_serdata*, ddsi_keyhash* hash, bool) noexcept {
  std::memset(hash, 0, sizeof *hash);
}

#ifdef DDS_HAS_SHM
// Never called: shared memory takes types of fixed size only.
std::uint32_t shared_memory_size(const ddsi_serdata*) noexcept {
  return 0;
}

ddsi_serdata* from_shared_memory(const ddsi_sertype* type,
                                 ddsi_serdata_kind kind,
                                 void*,
                                 void*) noexcept {
  return without_content(type, kind);
}
#endif

ddsi_serdata_ops make_data_ops() {
  ddsi_serdata_ops ops{};
  ops.eqkey = have_equal_keys;
  ops.get_size = size_of;
  ops.from_ser = from_fragments;
  ops.from_ser_iov = from_pieces;
  ops.from_keyhash = from_key_hash;
  ops.from_sample = from_sample;
  ops.to_ser = copy_bytes;
  ops.to_ser_ref = borrow_bytes;
  ops.to_ser_unref = return_bytes;
  ops.to_sample = to_sample;
  ops.to_untyped = to_untyped;
  ops.untyped_to_sample = untyped_to_sample;
  ops.free = free_data;
  ops.print = print_data;
  ops.get_keyhash = key_hash;
#ifdef DDS_HAS_SHM
  ops.get_sample_size = shared_memory_size;
  ops.from_iox_buffer = from_shared_memory;
#endif
  return ops;
}

// ---- what Cyclone calls: type -------------------------------------------------------------------

void free_type(ddsi_sertype* type) noexcept {
  ddsi_sertype_fini(type);
  delete static_cast<SerType*>(type);
}

void zero_samples(const ddsi_sertype*, void*, std::size_t) noexcept {}

void realloc_samples(void**, const ddsi_sertype*, void*, std::size_t, std::size_t) noexcept {
  std::abort();  // only loans and dds_take need samples made by Cyclone, and we use neither
}

void free_samples(const ddsi_sertype*, void**, std::size_t, dds_free_op_t) noexcept {}

bool are_equal(const ddsi_sertype*, const ddsi_sertype*) noexcept {
  return true;  // names have been compared
}

std::uint32_t hash_of(const ddsi_sertype*) noexcept {
  return 0;  // the name is in Cyclone's part
}

ddsi_sertype_ops make_type_ops() {
  ddsi_sertype_ops ops{};
  ops.version = ddsi_sertype_v0;
  ops.free = free_type;
  ops.zero_samples = zero_samples;
  ops.realloc_samples = realloc_samples;
  ops.free_samples = free_samples;
  ops.equal = are_equal;
  ops.hash = hash_of;
  return ops;
}

}  // namespace

Topic create_topic(dds_entity_t participant,
                   const std::string& dds_topic,
                   const std::string& dds_type,
                   std::shared_ptr<BufferPool> pool) {
  static const ddsi_serdata_ops data_ops = make_data_ops();
  static const ddsi_sertype_ops type_ops = make_type_ops();
  auto* type = new SerType{};
  type->pool = std::move(pool);
  ddsi_sertype_init_flags(
      type, dds_type.c_str(), &type_ops, &data_ops, DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  ddsi_sertype* registered = type;  // replaced when the domain knows an equal one
  Topic topic;
  topic.entity = dds_create_topic_sertype(
      participant, dds_topic.c_str(), &registered, nullptr, nullptr, nullptr);
  if (topic.entity < 0) {
    ddsi_sertype_unref(type);
    return topic;
  }
  topic.type = registered;
  return topic;
}

WireData::WireData(ddsi_serdata* owned) : data_(owned) {}

WireData::WireData(const Topic& topic, const WireSample& sample, Pacer& pacer)
    : data_(from_sample(topic.type, SDK_DATA, &sample)) {
  if (data_ != nullptr) {
    data_->timestamp.v = wall_clock_ns();
    data_->statusinfo = 0;
    mine(data_).pacer = &pacer;
  }
}

WireData::~WireData() {
  if (data_ != nullptr) {
    ddsi_serdata_unref(data_);
  }
}

WireData::WireData(WireData&& other) noexcept : data_(std::exchange(other.data_, nullptr)) {}

WireData& WireData::operator=(WireData&& other) noexcept {
  std::swap(data_, other.data_);
  return *this;
}

std::span<const std::uint8_t> WireData::cdr() const {
  const SerData& data = mine(data_);
  return {data.buffer.bytes.get(), data.size};
}

dds_return_t WireData::forward_to(dds_entity_t writer) {
  return dds_forwardcdr(writer, std::exchange(data_, nullptr));
}

}  // namespace trigpoint::bus::cyclonedds
