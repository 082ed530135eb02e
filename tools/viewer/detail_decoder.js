// Decodes blocks beside the page, which would stand still meanwhile: half a second for half a million
// splits. A worker of detail.js: takes { buffer, size } and answers { block } or { error }, one for
// each, in turn.

import { decodeBlock } from './detail_walk.js';

onmessage = ({ data: { buffer, size } }) => {
  try {
    const block = decodeBlock(buffer, size);
    const arrays = Object.values(block).filter(ArrayBuffer.isView);
    postMessage({ block }, arrays.map((array) => array.buffer));
  } catch (error) {
    postMessage({ error: `${error}` });
  }
};
