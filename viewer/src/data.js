// Reads the data that the page carries: JSON, with long arrays as base64 of little-endian numbers.

/** The page's data. */
export function pageData() {
  return JSON.parse(document.getElementById("report-data").textContent);
}

function bytes(text) {
  const raw = atob(text ?? "");
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}

/** base64 → bytes. */
export const unpackBytes = (text) => bytes(text);

/** base64 → 32-bit floats (the packer writes them little-endian, whatever the machine). */
export function unpackFloats(text) {
  const raw = bytes(text);
  const view = new DataView(raw.buffer);
  const out = new Float32Array(raw.length >> 2);
  for (let i = 0; i < out.length; i++) out[i] = view.getFloat32(4 * i, true);
  return out;
}
