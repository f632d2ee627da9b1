// What a browser says it is, in two words: "Firefox 128, Linux".
export function browser_text(agent: string): string {
  const [, name = '', version = ''] =
    /(Edg|OPR)\/(\d+)/.exec(agent) ??
    /(Firefox|Chrome)\/(\d+)/.exec(agent) ??
    /(Version)\/(\d+).*Safari/.exec(agent) ??
    [];
  const names: Record<string, string> = { Edg: 'Edge', OPR: 'Opera', Version: 'Safari' };
  const system = /Android|iPhone|iPad|Windows|Mac OS X|CrOS|Linux/.exec(agent)?.[0] ?? '';
  if (name === '') return agent.slice(0, 40) || 'not said';
  return `${names[name] ?? name} ${version}${system && `, ${system}`}`;
}
