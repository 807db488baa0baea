// What can be set, by the names that links and `show.json` use.

export interface Settings {
  seed: number;
  /** Steps a frame; those of the rule's training where it is 0. */
  steps: number;
  warmup: number;
  /** How fast the velocity carries patterns; as in a rule's training where it is below 0. */
  patternSpeed: number;
  strength: number;
  densityStrength: number;
  /** What γ of the rule is multiplied by. */
  density: number;
  /** Stops. */
  exposure: number;
  light: number;
  lightAzimuth: number;
  lightElevation: number;
  ambient: number;
  guide: number;
  guideAzimuth: number;
  guideElevation: number;
  mix: number;
  /** Where the line to the plain smoke stands, 0 … 1; 2: none. */
  wipe: number;
  /** Parts of a cell along each axis that are drawn. */
  detail: number;
  brush: number;
  /** 1 rounds the factors of a step to 16 bits, where the GPU has such numbers. */
  half: number;
}

export const DEFAULTS: Readonly<Settings> = {
  seed: 0,
  steps: 0,
  warmup: 64,
  patternSpeed: -1,
  strength: 1,
  densityStrength: 1,
  density: 1,
  exposure: 0,
  light: 2,
  lightAzimuth: -55,
  lightElevation: 40,
  ambient: 0.2,
  guide: 0,
  guideAzimuth: 0,
  guideElevation: 90,
  mix: 0,
  wipe: 2,
  detail: 1,
  brush: 5,
  half: 0,
};
