// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// PNG: W3C Recommendation, second edition, 2003. zlib and deflate: RFC 1950 and 1951.
#include "png.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace trigpoint::evaluation {

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kOpacities = 16;
constexpr std::uint8_t kGrey = 110;
constexpr double kDarkest = 0.95;  ///< opacity
constexpr double kLightest = 0.10;
constexpr std::size_t kBlockBytes = 65'535;  ///< of deflate's stored blocks

void put(Bytes& bytes, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  }
}

/// CRC-32 of annex D.
std::uint32_t crc_of(const Bytes& bytes, std::size_t from) {
  std::uint32_t crc = 0xffffffffU;
  for (std::size_t i = from; i < bytes.size(); ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
    }
  }
  return crc ^ 0xffffffffU;
}

void put_chunk(Bytes& png, const std::string& type, const Bytes& data) {
  put(png, static_cast<std::uint32_t>(data.size()));
  const std::size_t from = png.size();
  png.insert(png.end(), type.begin(), type.end());
  png.insert(png.end(), data.begin(), data.end());
  put(png, crc_of(png, from));
}

std::uint32_t adler_of(const Bytes& bytes) {
  std::uint32_t a = 1;
  std::uint32_t b = 0;
  for (const auto byte : bytes) {
    a = (a + byte) % 65'521;
    b = (b + a) % 65'521;
  }
  return b << 16U | a;
}

Bytes stored(const Bytes& bytes) {
  Bytes zlib{0x78, 0x01};
  for (std::size_t i = 0; i < bytes.size(); i += kBlockBytes) {
    const auto size = std::min(kBlockBytes, bytes.size() - i);
    zlib.push_back(i + size == bytes.size() ? 1 : 0);
    for (const std::size_t value : {size, ~size}) {
      zlib.push_back(static_cast<std::uint8_t>(value & 255U));
      zlib.push_back(static_cast<std::uint8_t>(value >> 8U & 255U));
    }
    const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(i);
    zlib.insert(zlib.end(), from, from + static_cast<std::ptrdiff_t>(size));
  }
  put(zlib, adler_of(bytes));
  return zlib;
}

/// Rows from the north, each after its filter byte (0: none), two cells a byte.
Bytes rows_of(const MapRaster& raster) {
  Bytes rows;
  const auto columns = static_cast<std::size_t>(raster.columns);
  for (auto row = static_cast<std::size_t>(raster.rows); row-- > 0;) {
    rows.push_back(0);
    const auto level = [&](std::size_t column) {
      const float darkness = column < columns ? raster.darkness[row * columns + column] : 0.0F;
      return darkness <= 0.0F
                 ? 0U
                 : static_cast<unsigned>(std::clamp(
                       std::lround(darkness * (kOpacities - 1)), 1L, long{kOpacities - 1}));
    };
    for (std::size_t column = 0; column < columns; column += 2) {
      rows.push_back(static_cast<std::uint8_t>(level(column) << 4U | level(column + 1)));
    }
  }
  return rows;
}

/// Level 0, an empty cell, is clear.
Bytes opacities() {
  Bytes alpha{0};
  for (int level = 1; level < kOpacities; ++level) {
    const double part = (level - 1.0) / (kOpacities - 2.0);
    alpha.push_back(
        static_cast<std::uint8_t>(std::lround(255 * (kLightest + part * (kDarkest - kLightest)))));
  }
  return alpha;
}

}  // namespace

std::vector<std::uint8_t> png_of(const MapRaster& raster) {
  Bytes png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  Bytes head;
  put(head, static_cast<std::uint32_t>(raster.columns));
  put(head, static_cast<std::uint32_t>(raster.rows));
  constexpr std::array<std::uint8_t, 5> kFourBitPalette{4, 3, 0, 0, 0};
  head.insert(head.end(), kFourBitPalette.begin(), kFourBitPalette.end());
  put_chunk(png, "IHDR", head);
  put_chunk(png, "PLTE", Bytes(3UL * kOpacities, kGrey));
  put_chunk(png, "tRNS", opacities());
  put_chunk(png, "IDAT", stored(rows_of(raster)));
  put_chunk(png, "IEND", {});
  return png;
}

}  // namespace trigpoint::evaluation
