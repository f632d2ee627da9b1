// VitePress's own theme, with the cockpit's colours and room for wide tables.
import DefaultTheme from 'vitepress/theme-without-fonts';
import './style.css';

export default DefaultTheme;
