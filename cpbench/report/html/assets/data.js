"use strict";
/* The results of the page: base64 of gzip of [length of the header, header as JSON, columns of numbers]. */
const Data = (() => {
  const TYPES = { u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array, f64: Float64Array };

  async function read(text) {
    const letters = atob(text),
      packed = new Uint8Array(letters.length);
    for (let k = 0; k < letters.length; k++) packed[k] = letters.charCodeAt(k);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const bytes = await new Response(stream).arrayBuffer();
    const length = new DataView(bytes).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
    const columns = {};
    for (const [name, { type, at, count }] of Object.entries(header.columns)) {
      columns[name] = new TYPES[type](bytes, at, count);
    }
    return { facts: header.facts, columns };
  }

  /* A text column of a row: the place among the distinct texts is what the column holds. */
  const text = (data, name, row) => data.facts.texts[name][data.columns[name][row]];

  return Object.freeze({ read, text });
})();
