// The shaders of a layer: of a rule of such a shape, on arrays in so many parts.

import brushCode from "../shaders/brush.wgsl";
import carryCode from "../shaders/carry.wgsl";
import conditionCode from "../shaders/condition.wgsl";
import eraseCode from "../shaders/erase.wgsl";
import paintCode from "../shaders/paint.wgsl";
import decoderCode from "../../../src/vnca/engine/wgsl/decoder.wgsl";
import stepCode from "../../../src/vnca/engine/wgsl/step.wgsl";
import { quarters } from "./weights";
import { smokeShader } from "../smoke/frame";
import type { Rule } from "./model";
import type { Layout } from "../gpu/rows";
import { sitesShader } from "./sites";
import type { Smoke } from "../smoke/smoke";

/** Bindings of arrays in parts; those of the state are in another group where it is painted. */
export const STATE = { group: 0, first: 512, element: "vec4f", width: "PLANES" };
export const PAINTED = { group: 2, first: 16, element: "vec4f" };
export const WANTED_PLACES = { group: 1, first: 16, element: "u32" };

export class Programs {
  private readonly planes: string;
  private readonly sizes: string;
  private readonly factor: string;
  private readonly fields: string;

  constructor(rule: Rule, smoke: Smoke, isHalf: boolean) {
    const units = rule.decoder.length > 0 ? quarters(rule.decoder[0].weights.rows) : 0;
    const told = quarters(rule.width + 1);
    this.factor = isHalf ? "enable f16;\nalias Factor = f16;\n" : "alias Factor = f32;\n";
    this.planes = `const PLANES = ${quarters(rule.channels)}u;\n`;
    this.sizes = `const TOLD = ${told}u;\nconst HIDDEN = ${rule.hidden.rows}u;\nconst UNITS4 = ${units}u;\n`;
    this.fields = toldFields(rule, smoke);
  }

  step(places: Layout, state: Layout): string {
    const reading = `${sitesShader(places)}${state.declared("state", STATE)}`;
    return `${this.factor}${this.planes}${this.sizes}${reading}${stepCode}`;
  }

  condition(places: Layout, words: Layout): string {
    return `${sitesShader(places)}${smokeShader(words)}${this.fields}${conditionCode}`;
  }

  carry(places: Layout, wantedPlaces: Layout, before: Layout, words: Layout): string {
    const wanted = wantedPlaces.declared("wanted_place", WANTED_PLACES);
    const states = before.declared("before", { ...STATE, group: 1 });
    return `${this.planes}${sitesShader(places)}${smokeShader(words)}${wanted}${states}${carryCode}`;
  }

  erase(places: Layout, words: Layout): string {
    return `${this.planes}${sitesShader(places)}${smokeShader(words)}${brushCode}${eraseCode}`;
  }

  /** Also the rim. */
  paint(places: Layout, state: Layout, painted: Layout): string {
    const width = "(now.parts * now.parts * now.parts)";
    const arrays =
      state.declared("state", { ...STATE, group: 2 }) +
      painted.declared("painted", { ...PAINTED, width, isWritten: true });
    return `${this.planes}${this.sizes}${sitesShader(places)}${arrays}${decoderCode}${paintCode}`;
  }
}

/** What a rule is told of fields: a line in the shader for each of their components. */
function toldFields(rule: Rule, smoke: Smoke): string {
  const number = (value: number): string => `${Math.fround(value).toExponential()}f`;
  const lines: string[] = [];
  for (const { name, scale, column } of rule.fields) {
    let component = 0;
    for (const field of smoke.fields) {
      for (let k = 0; field.name === name && k < field.width; k++) {
        const value = `${number(field.scale)} * field_at(${component + k}u, cell) / ${number(scale)}`;
        lines.push(`  told[first + ${column + k}u] = ${value};\n`);
      }
      component += field.width;
    }
  }
  return `fn tell_fields(first: u32, cell: vec3i) {\n${lines.join("")}}\n`;
}
