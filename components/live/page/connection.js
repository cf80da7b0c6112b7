// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The Foxglove WebSocket protocol, client's side: subscribes to what has a handler, and begins anew when
// the server comes back.
"use strict";

const kReconnect_ms = 1000;

// handlers: {topic: (message, bytes) => void}; onState(text, connected)
function connect(url, handlers, onState, onTime) {
  const socket = new WebSocket(url, ["foxglove.websocket.v1"]);
  const channels = new Map(); // by subscription id, which is the channel's number
  socket.binaryType = "arraybuffer";
  socket.onopen = () => onState("connected", true);
  socket.onclose = () => {
    onState("no connection to trigpoint live; trying again", false);
    setTimeout(() => connect(url, handlers, onState, onTime), kReconnect_ms);
  };
  const advertised = (list) => {
    const wanted = list.filter((channel) => channel.topic in handlers);
    for (const channel of wanted) {
      channels.set(channel.id, { handle: handlers[channel.topic], types: parseSchema(channel.schema) });
    }
    const subscriptions = wanted.map((channel) => ({ id: channel.id, channelId: channel.id }));
    socket.send(JSON.stringify({ op: "subscribe", subscriptions }));
  };
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") {
      const message = JSON.parse(data);
      if (message.op === "advertise") {
        advertised(message.channels);
      }
      return;
    }
    const view = new DataView(data);
    if (view.getUint8(0) === 2) {
      onTime(Number(view.getBigUint64(1, true)) / 1e9);
    } else if (view.getUint8(0) === 1) {
      const channel = channels.get(view.getUint32(1, true));
      const cdr = new Uint8Array(data, 13);
      channel?.handle(decodeCdr(channel.types, cdr), cdr.length);
    }
  };
}
