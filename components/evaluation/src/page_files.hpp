// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What stands in page/, compiled in: the page is made by the program alone.
#pragma once

namespace trigpoint::evaluation::page_files {

extern const char* const kStyle;  ///< page/style.css
extern const char* const kScene;  ///< page/scene.html
extern const char* const kPlots;  ///< page/plots.js
extern const char* const kMap3d;  ///< page/map_3d.js

}  // namespace trigpoint::evaluation::page_files
