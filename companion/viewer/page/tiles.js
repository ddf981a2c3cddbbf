// The map: cells of a few classes, which arrive as tiles, and how they are drawn.
//
// Tiles are painted into blocks: canvases of several tiles, so a large map is a few dozen images. Each block has a
// second, coarser picture in which a single obstacle keeps its group of cells visible when the map is seen from afar.

export const UNKNOWN = 0;
export const FREE = 1;
export const OBSTACLE = 2;
export const CLOSED = 3;
export const COSTLY = 4;

const TILES_A_BLOCK = 8;
const COARSE = 4;
/** Below this size of a cell on the screen the coarse pictures are drawn. */
const COARSE_BELOW_PX = 0.6;
/** Which class a group of cells shows: the higher wins. */
const STRENGTH = new Uint8Array([0, 1, 4, 3, 2, 0, 0, 0]);
const HEAD = 0x314c4954; // "TIL1", read as a little-endian number

/** Splits a message into `{column, row, bytes}`; what is cut off or has another beginning is left out. */
export function split(buffer) {
  const view = new DataView(buffer);
  const tiles = [];
  if (view.byteLength < 4 || view.getUint32(0, true) !== HEAD) return tiles;
  let at = 4;
  while (at + 6 <= view.byteLength) {
    const size = view.getUint16(at + 4, true);
    if (at + 6 + size > view.byteLength) break;
    const bytes = new Uint8Array(buffer, at + 6, size);
    tiles.push({ column: view.getUint16(at, true), row: view.getUint16(at + 2, true), bytes });
    at += 6 + size;
  }
  return tiles;
}

/** The classes of one tile's cells, row by row from the south-west. */
export function unpack(bytes, cells) {
  let at = 0;
  for (const byte of bytes) {
    const end = Math.min(cells.length, at + (byte & 31) + 1);
    cells.fill(byte >> 5, at, end);
    at = end;
  }
  cells.fill(UNKNOWN, at);
}

/** The map of a scene. Without a map in the scene it stays empty. */
export class TileMap {
  constructor(shape) {
    this.shape = shape;
    this.across = shape ? Math.ceil(shape.columns / shape.tile) : 0;
    this.up = shape ? Math.ceil(shape.rows / shape.tile) : 0;
    this.clear();
  }

  clear() {
    this.tiles = new Map();
    this.blocks = new Map();
    this.dirty = new Set();
    this.seen = null; // columns and rows of cells: [west, south, east, north], the last two beyond
  }

  /** Takes one tile; tiles outside the map are ignored. */
  put(column, row, bytes) {
    if (column >= this.across || row >= this.up) return;
    const key = row * this.across + column;
    let cells = this.tiles.get(key);
    if (!cells) this.tiles.set(key, (cells = new Uint8Array(this.shape.tile ** 2)));
    unpack(bytes, cells);
    this.dirty.add(key);
    this.widen(column, row, cells);
  }

  // Ground that was seen, of this tile, belongs to what there is to look at. What a mission closes does not.
  widen(column, row, cells) {
    const { tile } = this.shape;
    const [x0, y0] = [column * tile, row * tile];
    const [west, south, east, north] = this.seen ?? [Infinity, Infinity, -Infinity, -Infinity];
    if (x0 >= west && y0 >= south && x0 + tile <= east && y0 + tile <= north) return;
    let [left, low, right, high] = [west, south, east, north];
    cells.forEach((kind, i) => {
      if (kind !== FREE && kind !== OBSTACLE) return;
      const [x, y] = [x0 + (i % tile), y0 + Math.floor(i / tile)];
      [left, low] = [Math.min(left, x), Math.min(low, y)];
      [right, high] = [Math.max(right, x + 1), Math.max(high, y + 1)];
    });
    if (right > left) this.seen = [left, low, right, high];
  }

  /** Two corners of the ground that was seen so far, north and east in metres; none before. */
  bounds() {
    if (!this.seen) return [];
    const { south_m: south, west_m: west, cell_m: cell } = this.shape;
    const [left, low, right, high] = this.seen;
    return [
      [south + low * cell, west + left * cell],
      [south + high * cell, west + right * cell],
    ];
  }

  /** Makes one tile unknown again, for seeking back in a record. */
  forget(column, row) {
    const key = row * this.across + column;
    this.tiles.get(key)?.fill(UNKNOWN);
    if (this.tiles.has(key)) this.dirty.add(key);
  }

  /** Everything must be painted again, because the colours have changed. */
  repaint() {
    for (const key of this.tiles.keys()) this.dirty.add(key);
  }

  /** Draws the map with the context's transform set to (east, north) in metres. */
  draw(context, camera, colours) {
    if (!this.shape) return;
    this.paint(colours);
    const { south_m: south, west_m: west, cell_m: cell, tile } = this.shape;
    const side = tile * TILES_A_BLOCK * cell;
    const coarse = camera.scale * cell < COARSE_BELOW_PX;
    const seam = 0.5 / camera.scale; // blocks overlap by half a pixel, or a hair line would show between them
    context.imageSmoothingEnabled = camera.scale * cell < 1;
    for (const block of this.blocks.values()) {
      const east = west + block.column * side;
      const north = south + block.row * side;
      if (!camera.sees(north, east, north + side, east + side)) continue;
      context.save();
      context.translate(east, north + side);
      context.scale(1, -1);
      context.drawImage(coarse ? block.coarse : block.fine, -seam, -seam, side + 2 * seam, side + 2 * seam);
      context.restore();
    }
  }

  paint(colours) {
    if (this.dirty.size === 0) return;
    const inks = inksOf(colours);
    for (const key of this.dirty) {
      const column = key % this.across;
      const row = Math.floor(key / this.across);
      this.paintTile(this.block(column, row), column % TILES_A_BLOCK, row % TILES_A_BLOCK, this.tiles.get(key), inks);
    }
    this.dirty.clear();
  }

  block(tileColumn, tileRow) {
    const column = Math.floor(tileColumn / TILES_A_BLOCK);
    const row = Math.floor(tileRow / TILES_A_BLOCK);
    const key = row * 65536 + column;
    let block = this.blocks.get(key);
    if (!block) {
      const side = this.shape.tile * TILES_A_BLOCK;
      block = { column, row, fine: blank(side), coarse: blank(Math.ceil(side / COARSE)) };
      this.blocks.set(key, block);
    }
    return block;
  }

  // Pictures have their first row on top, tiles have it in the south.
  paintTile(block, column, row, cells, inks) {
    const tile = this.shape.tile;
    const fine = new ImageData(tile, tile);
    const pixels = new Uint32Array(fine.data.buffer);
    for (let y = 0; y < tile; y += 1) {
      const from = (tile - 1 - y) * tile;
      for (let x = 0; x < tile; x += 1) {
        const kind = cells[from + x];
        pixels[y * tile + x] = kind === CLOSED && ((x + y) & 3) === 0 ? inks.closedLine : inks.of[kind];
      }
    }
    const top = (TILES_A_BLOCK - 1 - row) * tile;
    block.fine.getContext("2d").putImageData(fine, column * tile, top);
    const small = this.coarsened(cells, inks);
    block.coarse.getContext("2d").putImageData(small, (column * tile) / COARSE, top / COARSE);
  }

  coarsened(cells, inks) {
    const tile = this.shape.tile;
    const side = Math.ceil(tile / COARSE);
    const strongest = new Uint8Array(side * side);
    for (let i = 0; i < cells.length; i += 1) {
      const at = (side - 1 - Math.floor(Math.floor(i / tile) / COARSE)) * side + Math.floor((i % tile) / COARSE);
      if (STRENGTH[cells[i]] > STRENGTH[strongest[at]]) strongest[at] = cells[i];
    }
    const picture = new ImageData(side, side);
    const pixels = new Uint32Array(picture.data.buffer);
    for (let i = 0; i < pixels.length; i += 1) pixels[i] = inks.of[strongest[i]];
    return picture;
  }
}

// Unknown cells stay transparent: the ground below has their colour already.
function inksOf(colours) {
  const of = new Uint32Array(8);
  of[FREE] = ink(colours.free);
  of[OBSTACLE] = ink(colours.obstacle);
  of[CLOSED] = ink(colours.closed);
  of[COSTLY] = ink(colours.costly);
  return { of, closedLine: ink(colours.closedLine) };
}

function ink(colour) {
  const value = parseInt(colour.slice(1), 16);
  return (0xff000000 | ((value & 255) << 16) | (value & 0xff00) | (value >> 16)) >>> 0;
}

function blank(side) {
  const canvas = document.createElement("canvas");
  canvas.width = side;
  canvas.height = side;
  return canvas;
}
