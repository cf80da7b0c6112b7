// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "page_document.hpp"

#include "html.hpp"
#include "page_files.hpp"

namespace trigpoint::evaluation {

namespace {

constexpr const char* kHead =
    "<meta charset=\"utf-8\"/>\n"
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src "
    "'unsafe-inline'; script-src 'unsafe-inline'; img-src data:\"/>\n"
    "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
    "<meta name=\"color-scheme\" content=\"light dark\"/>\n";

}  // namespace

std::string html_of(const PageDocument& page) {
  std::string scripts;
  for (const std::string& script : page.scripts) {
    scripts += "<script>\n" + script + "</script>\n";
  }
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n" + std::string(kHead) + "<title>" +
         html::escape(page.title) + "</title>\n<style>\n" + page_files::kStyle +
         "</style>\n</head>\n<body>\n" + page.body + scripts + "</body>\n</html>\n";
}

}  // namespace trigpoint::evaluation
